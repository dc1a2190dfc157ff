// Marks of the floor are clicked, their distances typed; the grid of the floor shows where the camera stands.
import { Picture } from 'gait/film.js';

const NEAR = 14; // screen pixels within which a mark is taken
const SLOW = 400; // milliseconds from which an answer that is awaited is announced
const about = await (await fetch('/about.json')).json();
const KEY = `gait camera ${about.name} ${about.size}`;
const state = { marks: [], lengths: {}, mode: 'distances', frame: about.first, chosen: -1, found: null, fault: '' };
try {
  Object.assign(state, JSON.parse(sessionStorage.getItem(KEY) ?? '{}'), { chosen: -1, found: null });
} catch { /* what another version left */ }

const make = (tag, more = {}, ...children) => {
  const { dataset, ...own } = more;
  const element = Object.assign(document.createElement(tag), own);
  Object.assign(element.dataset, dataset ?? {});
  element.append(...children);
  return element;
};
const letter = (k) => (k < 26 ? '' : String.fromCharCode(64 + Math.floor(k / 26))) + String.fromCharCode(65 + (k % 26));

// ---- the page
const film = make('div', { className: 'film' });
const stage = make('div');
film.append(stage);
const image = make('img', { alt: `A frame of ${about.name}`, src: `/frame/${state.frame}.jpg`, draggable: false });
const slider = make('input', { type: 'range', min: 0, max: about.frames - 1, value: state.frame, ariaLabel: 'Frame of the film' });
const clock = make('span', { className: 'number faint' });
const bar = make('div', { className: 'bar' });
const fit = make('button', { type: 'button', textContent: '⤢', title: 'Show the whole picture' });
fit.setAttribute('aria-label', 'Show the whole picture');
const wider = make('button', { type: 'button', textContent: '+', title: 'Zoom in' });
wider.setAttribute('aria-label', 'Zoom in');
const track = make('div', { className: 'row', style: 'flex: 1' });
if (about.frames > 1) track.append(slider, clock);
bar.append(wider, fit, track);
film.append(bar);

const verdict = make('div', { className: 'panel', role: 'status' });
verdict.setAttribute('aria-live', 'polite');
const table = make('div');
const radio = (value, text) => {
  const input = make('input', { type: 'radio', name: 'mode', value, checked: state.mode === value });
  input.addEventListener('change', () => { state.mode = value; changed(); });
  return make('label', {}, input, ` ${text}`);
};
const save = make('button', { type: 'button', className: 'primary', textContent: `Write ${about.output}`, disabled: true });
const clear = make('button', { type: 'button', textContent: 'Start again' });
const help = make('ol', {},
  make('li', { textContent: 'Click at least four marks on the floor, far apart. Drag to move a mark, use the wheel to zoom; arrow keys move the selected mark by half a pixel, Delete removes it.' }),
  make('li', { textContent: 'Type the measured distances between them.' }),
  make('li', { textContent: 'The blue grid must lie on the floor, the pole must be as high as a person. Then write the file.' }));
document.getElementById('page').append(
  make('section', { className: 'view', ariaLabel: 'Picture' }, film),
  make('section', { className: 'side', ariaLabel: 'Marks' },
    make('h1', { textContent: `Where is the camera of ${about.name}?` }), help, verdict, make('div', { className: 'row' }, save, clear),
    make('fieldset', {}, make('legend', { textContent: 'I measured' }),
      make('div', { className: 'row' }, radio('distances', 'distances between marks'), radio('positions', 'positions x, y'))),
    table, make('p', { className: 'faint', textContent: about.lens })));
document.head.append(make('link', { rel: 'stylesheet', href: '/page/camera_page.css' }));

// ---- the picture
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
function paint(context, view) {
  const stroke = (points, width, colour) => {
    context.beginPath();
    points.forEach((uv, k) => context[k ? 'lineTo' : 'moveTo'](...view.toScreen(uv)));
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.stroke();
  };
  const found = state.found;
  const corners = [[-0.5, -0.5], about.size].map((uv) => view.toScreen(uv));
  context.save();
  context.beginPath();
  context.rect(...corners[0], corners[1][0] - corners[0][0], corners[1][1] - corners[0][1]);
  context.clip();
  if (found) {
    for (const line of found.grid) { stroke(line, 3, 'rgba(255,255,255,0.55)'); stroke(line, 1.4, '#0072b2'); }
    stroke(found.pole, 7, '#fff');
    stroke(found.pole, 4, '#b34a00');
    const [x, y] = view.toScreen(found.pole[1]);
    label(context, '1.75 m', x + 8, y + 4);
    found.shown.forEach((uv) => {
      const [u, v] = view.toScreen(uv);
      context.strokeStyle = '#0072b2';
      context.lineWidth = 2;
      context.strokeRect(u - 5, v - 5, 10, 10);
    });
  }
  context.restore();
  state.marks.forEach(({ uv }, k) => {
    const [x, y] = view.toScreen(uv);
    for (const [width, colour] of [[5, '#000'], [2, k === state.chosen ? '#f0e442' : '#fff']]) {
      context.lineWidth = width;
      context.strokeStyle = colour;
      context.beginPath();
      context.moveTo(x - 9, y); context.lineTo(x + 9, y); context.moveTo(x, y - 9); context.lineTo(x, y + 9);
      context.stroke();
    }
    label(context, letter(k), x + 10, y - 8);
  });
}
function label(context, text, x, y) {
  context.font = '600 15px system-ui, sans-serif';
  context.lineWidth = 4;
  context.strokeStyle = '#000';
  context.strokeText(text, x, y);
  context.fillStyle = '#fff';
  context.fillText(text, x, y);
}
const picture = new Picture(stage, image, about.size, paint);
image.addEventListener('load', () => picture.redraw());
fit.addEventListener('click', () => picture.fit());
wider.addEventListener('click', () => picture.zoomBy(1.6));
slider.addEventListener('change', () => {
  state.frame = Number(slider.value);
  image.src = `/frame/${state.frame}.jpg`;
  remember();
  clock.textContent = `frame ${state.frame}`;
});
clock.textContent = `frame ${state.frame}`;

let held = null;
const { canvas } = picture;
canvas.tabIndex = 0;
canvas.setAttribute('aria-label', 'Picture: click marks on the floor');
canvas.addEventListener('pointerdown', (event) => {
  const at = picture.at(event);
  const distances = state.marks.map(({ uv }) => Math.hypot(...picture.toScreen(uv).map((n, k) => n - at[k])));
  const nearest = distances.indexOf(Math.min(...distances, NEAR));
  held = { mark: nearest, from: at, moved: false };
  state.chosen = nearest;
  canvas.setPointerCapture(event.pointerId);
  show();
});
canvas.addEventListener('pointermove', (event) => {
  if (!held) return;
  const at = picture.at(event);
  if (Math.hypot(at[0] - held.from[0], at[1] - held.from[1]) > 3) held.moved = true;
  if (!held.moved) return;
  if (held.mark >= 0) state.marks[held.mark].uv = within(picture.toPicture(at));
  else { picture.panBy(at[0] - held.from[0], at[1] - held.from[1]); held.from = at; }
  picture.redraw();
});
canvas.addEventListener('pointerup', (event) => {
  if (!held) return;
  if (held.mark < 0 && !held.moved) {
    state.marks.push({ uv: within(picture.toPicture(picture.at(event))), x: '', y: '' });
    state.chosen = state.marks.length - 1;
  }
  held = null;
  changed();
});
canvas.addEventListener('keydown', (event) => {
  const step = { ArrowLeft: [-0.5, 0], ArrowRight: [0.5, 0], ArrowUp: [0, -0.5], ArrowDown: [0, 0.5] }[event.key];
  const mark = state.marks[state.chosen];
  if (!mark) return;
  if (step) mark.uv = within(mark.uv.map((n, k) => n + step[k]));
  else if (event.key === 'Delete' || event.key === 'Backspace') remove(state.chosen);
  else return;
  event.preventDefault();
  changed();
});
function within(uv) {
  return uv.map((n, k) => Math.round(10 * Math.min(about.size[k] - 1, Math.max(0, n))) / 10);
}
function remove(k) {
  const kept = {};
  for (const [pair, length] of Object.entries(state.lengths)) {
    const both = pair.split('-').map(Number);
    if (!both.includes(k)) kept[both.map((n) => (n > k ? n - 1 : n)).join('-')] = length;
  }
  state.lengths = kept;
  state.marks.splice(k, 1);
  state.chosen = -1;
}

// ---- the table
function number(text) {
  const value = Number(String(text).trim().replace(',', '.'));
  return String(text).trim() !== '' && Number.isFinite(value) ? value : null;
}
function field(value, name, put) {
  const input = make('input', { type: 'text', inputMode: 'decimal', value, ariaLabel: name });
  input.addEventListener('input', () => { put(input.value); later(); });
  return make('td', {}, input);
}
function rows() {
  const gone = (k) => {
    const button = make('button', { type: 'button', textContent: '✕', ariaLabel: `Remove mark ${letter(k)}` });
    button.addEventListener('click', () => { remove(k); changed(); });
    return make('td', {}, button);
  };
  const head = state.mode === 'positions' ? ['mark', 'x (m)', 'y (m)', 'off (px)', ''] : ['mark', 'pixel', 'off (px)', ''];
  const marks = make('table', {}, make('tr', {}, ...head.map((text) => make('th', { textContent: text }))));
  state.marks.forEach((mark, k) => {
    const off = make('td', { className: 'number', dataset: { off: k } });
    const own = state.mode === 'positions'
      ? [field(mark.x, `x of mark ${letter(k)}, metres`, (text) => { mark.x = text; }),
        field(mark.y, `y of mark ${letter(k)}, metres`, (text) => { mark.y = text; })]
      : [make('td', { className: 'number faint', textContent: mark.uv.map((n) => n.toFixed(1)).join(', ') })];
    marks.append(make('tr', {}, make('td', { textContent: letter(k) }), ...own, off, gone(k)));
  });
  table.replaceChildren(marks);
  if (state.mode !== 'distances' || state.marks.length < 2) return;
  const lengths = make('table', {}, make('tr', {}, ...['from – to', 'metres', 'off (cm)'].map((text) => make('th', { textContent: text }))));
  for (let i = 0; i < state.marks.length; i++) {
    for (let j = i + 1; j < state.marks.length; j++) {
      const pair = `${i}-${j}`, name = `${letter(i)} – ${letter(j)}`;
      lengths.append(make('tr', {}, make('td', { textContent: name }),
        field(state.lengths[pair] ?? '', `Metres from ${letter(i)} to ${letter(j)}`, (text) => { state.lengths[pair] = text; }),
        make('td', { className: 'number', dataset: { pair } })));
    }
  }
  table.append(lengths);
}

// ---- the answer
function asked() {
  const uv = state.marks.map((mark) => mark.uv);
  if (state.mode === 'positions') return { uv, xy: state.marks.map(({ x, y }) => [number(x), number(y)]) };
  const distances = Object.entries(state.lengths).map(([pair, text]) => [...pair.split('-').map(Number), number(text)]);
  return { uv, distances: distances.filter(([, , metres]) => metres !== null) };
}
async function send(path) {
  const body = JSON.stringify(asked());
  const answer = await fetch(path, { method: 'POST', headers: { 'Content-Type': 'application/json' }, body })
    .catch(() => { throw new Error('the command has ended; start gait camera --page again'); });
  if (!answer.ok) throw new Error(`the command answered ${answer.status}`);
  return answer.json();
}
let turn = 0;
async function solve() {
  const mine = ++turn;
  const slow = setTimeout(() => {
    verdict.replaceChildren(make('p', { className: 'faint', style: 'margin: 0', textContent: 'checking…' }));
  }, SLOW);
  let found;
  try {
    found = await send('/place');
  } catch (error) {
    found = { fault: error.message };
  }
  clearTimeout(slow);
  if (mine !== turn) return;
  state.found = found.fault ? null : found;
  state.fault = found.fault ?? '';
  show();
}
function show() {
  const found = state.found;
  save.disabled = !found;
  document.querySelectorAll('[data-off]').forEach((cell) => {
    cell.textContent = found ? found.off[Number(cell.dataset.off)].toFixed(1) : '';
  });
  const given = asked().distances ?? [];
  document.querySelectorAll('[data-pair]').forEach((cell) => {
    const k = given.findIndex(([i, j]) => `${i}-${j}` === cell.dataset.pair);
    cell.textContent = found && k >= 0 && found.missed_m.length ? Math.abs(100 * found.missed_m[k]).toFixed(1) : '';
  });
  const words = make('p', { style: 'margin: 0' });
  if (found) {
    const [x, y, z] = found.place, far = Math.max(...found.off);
    words.className = found.rms < 3 ? 'good' : 'fault';
    words.textContent = `${found.rms < 3 ? 'Fits' : 'Does not fit well'}: ${found.rms.toFixed(1)} px rms, ${far.toFixed(1)} px at worst (mark ${letter(found.off.indexOf(far))}). `
      + `Camera ${z.toFixed(2)} m above the floor, at x ${x.toFixed(2)}, y ${y.toFixed(2)} m.`
      + (found.sd ? ` Focal length ${found.focal.toFixed(0)} px ± ${(100 * found.sd).toFixed(0)} % from the marks.` : '');
  } else {
    words.className = 'fault';
    words.textContent = state.fault;
  }
  verdict.replaceChildren(words);
  picture.redraw();
}
function remember() {
  const { marks, lengths, mode, frame } = state;
  sessionStorage.setItem(KEY, JSON.stringify({ marks, lengths, mode, frame }));
}
let waiting;
function later() {
  remember();
  clearTimeout(waiting);
  waiting = setTimeout(solve, 150);
}
function changed() {
  rows();
  show();
  later();
}
clear.addEventListener('click', () => { Object.assign(state, { marks: [], lengths: {}, chosen: -1, found: null }); changed(); });
save.addEventListener('click', async () => {
  let words;
  try {
    const found = await send('/save');
    words = found.fault ? `Not written: ${found.fault}` : `${about.output} is written. Close this page, and end the command with Ctrl-C.`;
  } catch (error) {
    words = `Not written: ${error.message}`;
  }
  verdict.append(make('p', { textContent: words, id: 'written' }));
});
window.page = { state, picture };
changed();
