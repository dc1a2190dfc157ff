// The studio: corrections by hand on the film, saved and solved by the server as they are made.
import { Scene } from 'gait/scene.js';
import { Film } from 'gait/film.js';
import { Curves } from 'gait/curves.js';

const NEAR = 14; // screen pixels within which the pointer takes a joint
const CLICK = 3; // screen pixels that a click may be off
const BUTTONS = { pin: 'tool-pin', start: 'tool-start', hide: 'hide', swap: 'swap' }; // by tool
const REFUSED = 409; // an edit that changes nothing: what there was is saved
const WAIT = 250; // milliseconds after the last key before a moved joint is sent
const NINETY = 2.1460; // radius of the circle that holds 90 % of a Gaussian in two dimensions, sd
const at = (id) => document.getElementById(id);

let data, film, scene, curves;
let tool = 'pull';
let over = -1; // joint under the pointer
let chosen = 0; // joint of the list
let pulled = null; // { joint, uv } while it is dragged or moved by keys
let panning = null;
let placing = null; // [from, to] while a start is dragged
let range = [null, null];
let proposal = -1;
let following = false;
let sent = 0;
let timer = 0;
let asking = 0; // edits that are not answered yet
let reported = -1; // version of the motion that the server has

const frameOf = (index) => index + data.first;
const indexOf = (frame) => frame - data.first;
const words = (joint) => joint.replace(/^l_/, 'left ').replace(/^r_/, 'right ').replace('_', ' ');

async function ask(path, body) {
  const answer = await fetch(path, body === undefined ? {} : { method: 'POST', body: JSON.stringify(body) })
    .catch(() => { throw new Error('gait studio has ended; start it again: all corrections are saved'); });
  const found = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(found.error ?? answer.statusText), { refused: answer.status === REFUSED });
  return found;
}

function announce(text, seconds = 5) {
  at('message').textContent = text;
  at('message').classList.add('shown');
  clearTimeout(announce.timer);
  announce.timer = setTimeout(() => at('message').classList.remove('shown'), 1000 * seconds);
}

const hush = () => at('message').classList.remove('shown');

// ---- what is shown

/** Whether a joint is moved or an edit is answered, which a whole motion must not keep waiting. */
const busy = () => asking || pulled || placing;

/** Show what the server has, if it is newer. */
function refresh() {
  if (data && reported > data.version && !busy()) load();
}

async function load() {
  const found = await ask('/state');
  if (busy()) return; // it is shown afterwards
  if (found.begun === data?.begun && found.version < data.version) return; // an edit was answered meanwhile
  const first = !data;
  data = found;
  document.title = `gait studio: ${data.title}`;
  at('title').textContent = data.title;
  if (first) build();
  else {
    scene.setData(data);
    film.setData(data);
    curves.setData(data);
  }
  lists();
  window.studio = Object.assign(window.studio ?? {}, { data, film, scene, curves }); // for tests and the curious
}

function build() {
  film = new Film(at('film'), data, '/film.mp4', paint, moved);
  scene = new Scene(at('scene'), data);
  curves = new Curves(at('curves'), data, (index) => { film.pause(); film.seek(index); });
  at('joint').replaceChildren(...data.joints.map((joint, j) => new Option(words(joint), j)));
  for (const [tool, id] of Object.entries(BUTTONS)) at(id).setAttribute('aria-disabled', tool in data.without);
  const { canvas } = film.picture;
  canvas.addEventListener('pointermove', hover);
  canvas.addEventListener('pointerdown', press);
  canvas.addEventListener('pointerup', release);
  canvas.addEventListener('pointercancel', () => { panning = null; drop(); });
  canvas.addEventListener('contextmenu', remove);
  canvas.setAttribute('role', 'application');
  canvas.setAttribute('aria-label', 'The figure over the film. Select a joint and press Alt with an arrow key to move it.');
  canvas.tabIndex = 0;
}

/** Keep the person in the middle, or show the whole picture. */
function follow(on) {
  following = on;
  at('follow').setAttribute('aria-pressed', on);
  if (!on) return film.picture.fit();
  film.picture.zoom = near();
  track(film.index);
}

/** Zoom at which the person is three quarters as high as the stage. */
function near() {
  const stage = film.picture.element;
  const whole = Math.min(stage.clientWidth / data.size[0], stage.clientHeight / data.size[1]);
  return Math.max(1, (0.75 * stage.clientHeight) / (data.tall * whole));
}

function track(index) {
  const uv = data.uv?.[index];
  if (!uv) return;
  const middle = [0, 1].map((axis) => {
    const values = uv.map((p) => p[axis]);
    return (Math.min(...values) + Math.max(...values)) / 2;
  });
  film.picture.look(middle);
}

function moved(index) {
  if (following && film) track(index);
  scene?.show(index);
  curves?.show(index);
  if (timer) send();
  else if (pulled) drop();
}

/** Leave the joint, or the start, where it was. */
function drop() {
  pulled = placing = null;
  film.redraw();
  refresh();
}

function corrections() {
  return data.edits.corrections ?? [];
}

/** Corrections of a frame, by joint. */
function corrected(frame) {
  return new Map(corrections().filter((c) => c.frame === frame).map((c) => [c.joint, c]));
}

function hidden(joint, frame) {
  return (data.edits.hidden ?? []).some((h) => h.joint === joint && h.first <= frame && frame <= h.last);
}

function paint(context, picture, index) {
  const uv = data?.uv?.[index];
  if (!uv) return;
  const places = uv.map((p, j) => picture.toScreen(pulled?.joint === j && (pulled.index ?? index) === index ? pulled.uv : p));
  const fixed = corrected(frameOf(index)), spread = data.uv_sd?.[index];
  context.lineCap = 'round';
  const thick = Math.min(2.5, Math.max(1.2, 0.007 * data.tall * picture.scale));
  for (const [wide, halo] of [[2 * thick, true], [thick, false]]) {
    for (const [k, [a, b]] of data.bones.entries()) {
      const side = data.bone_sides[k];
      context.strokeStyle = halo ? 'rgba(0,0,0,0.55)' : INK[side];
      context.lineWidth = wide;
      context.setLineDash(!halo && side === 'right' ? [7, 5] : []);
      line(context, places[a], places[b]);
    }
  }
  context.setLineDash([]);
  data.joints.forEach((joint, j) => {
    const [x, y] = places[j], side = data.sides[j];
    if (spread && (scene?.shown.ellipsoids ?? true)) {
      context.strokeStyle = 'rgba(255,255,255,0.45)';
      context.lineWidth = 1;
      ring(context, x, y, Math.min(NINETY * spread[j] * picture.scale, 400));
    }
    const big = j === over || j === chosen || pulled?.joint === j;
    context.fillStyle = hidden(joint, frameOf(index)) ? 'rgba(0,0,0,0.2)' : INK[side];
    context.strokeStyle = j === chosen ? '#ffffff' : '#000000';
    context.lineWidth = j === chosen ? 2 : 1;
    context.beginPath();
    // A square on the right side, a disc on the left and in the middle: not by colour alone.
    const r = (big ? 1.5 : 1) * Math.min(5, Math.max(2, 0.014 * data.tall * picture.scale));
    if (side === 'right') context.rect(x - r * 0.9, y - r * 0.9, 1.8 * r, 1.8 * r);
    else context.arc(x, y, r, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
    const own = fixed.get(joint);
    if (own) {
      const [u, v] = picture.toScreen(own.uv);
      context.strokeStyle = '#ffffff';
      context.lineWidth = 2;
      line(context, [x, y], [u, v]);
      ring(context, u, v, 9);
    }
    if (j === over || pulled?.joint === j) label(context, words(joint), x, y);
  });
  const arrow = placing ?? (data.start?.frame === frameOf(index) ? [data.start.from, data.start.to] : null);
  if (arrow) drawArrow(context, ...arrow.map((end) => picture.toScreen(end)));
  for (const pin of (data.edits.floor ?? []).filter((p) => p.frame === frameOf(index))) {
    const [u, v] = picture.toScreen(pin.uv);
    context.strokeStyle = '#ffffff';
    context.lineWidth = 2;
    line(context, [u - 9, v], [u + 9, v]);
    line(context, [u, v], [u, v - 9]);
  }
}

const INK = { left: '#56b4e9', right: '#e69f00', middle: '#f0f0f0' }; // over any film, with a dark edge

function line(context, a, b) {
  context.beginPath();
  context.moveTo(...a);
  context.lineTo(...b);
  context.stroke();
}

function drawArrow(context, from, to) {
  const about = Math.atan2(to[1] - from[1], to[0] - from[0]);
  for (const [ink, wide] of [['#000000', 6], ['#f0e442', 3]]) {
    context.strokeStyle = ink;
    context.lineWidth = wide;
    line(context, from, to);
    for (const turn of [2.6, -2.6]) line(context, to, [to[0] + 12 * Math.cos(about + turn), to[1] + 12 * Math.sin(about + turn)]);
    ring(context, ...from, 6);
  }
}

function ring(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
}

function label(context, text, x, y) {
  context.font = '13px system-ui, sans-serif';
  const wide = context.measureText(text).width;
  context.fillStyle = 'rgba(0,0,0,0.75)';
  context.fillRect(x + 10, y - 24, wide + 10, 20);
  context.fillStyle = '#ffffff';
  context.fillText(text, x + 15, y - 9);
}

function button(text, title, press) {
  const found = Object.assign(document.createElement('button'), { type: 'button', textContent: text, title });
  found.addEventListener('click', press);
  return found;
}

function row(...buttons) {
  const item = document.createElement('li');
  item.append(...buttons);
  return item;
}

function lists(saved = 'saved') {
  at('saved').textContent = saved;
  at('saved').title = data.file;
  at('undo').disabled = !data.undo;
  at('redo').disabled = !data.redo;
  at('proposals').replaceChildren(...data.proposals.map((p, k) => row(
    button(`${words(p.joint)}, frame ${p.frame} · ${p.px.toFixed(0)} px`, 'Go there and select the joint', () => propose(k)))));
  at('sufficient').hidden = data.proposals.length > 0;
  const entries = [];
  const add = (list, index, text, frame, joint) => entries.push({ frame, item: row(
    button(text, 'Go there', () => go(frame, joint)),
    button('×', `Remove: ${text}`, () => change('/edit', { do: 'remove', list, index }))) });
  corrections().forEach((c, k) => add('corrections', k, `${words(c.joint)} @ ${c.frame}`, c.frame, c.joint));
  (data.edits.hidden ?? []).forEach((h, k) => add('hidden', k, `${words(h.joint)} not visible ${span(h)}`, h.first, h.joint));
  (data.edits.swapped ?? []).forEach((s, k) => add('swapped', k, `left/right swapped ${span(s)}`, s.first));
  (data.edits.floor ?? []).forEach((p, k) => add('floor', k, `${words(p.joint)} on floor @ ${p.frame}`, p.frame, p.joint));
  entries.sort((a, b) => a.frame - b.frame);
  at('edits').replaceChildren(...entries.map((entry) => entry.item));
  for (const close of at('edits').querySelectorAll('li button + button')) close.setAttribute('aria-label', close.title);
  at('count').textContent = entries.length ? `(${entries.length})` : '(none yet)';
  at('command').textContent = at('command').title = data.command;
  at('start').textContent = data.start ? `Start in frame ${data.start.frame}: ${data.start.command}` : '';
  at('warnings').textContent = [data.fault, ...data.warnings].filter(Boolean).join('\n').replace(/\b[lr]_\w+/g, words);
  solved();
}

/** What it took, and how good it is. */
function solved() {
  const { px, sd_mm: sd } = data.figures;
  at('solved').textContent = `${sent ? `shown in ${sent} ms · ` : ''}${data.refining ? 'refining the whole…' : `${px === null ? '' : `${px} px from the points, `}± ${sd.toFixed(0)} mm`}`;
}

const span = ({ first, last }) => (first === last ? `@ ${first}` : `${first}–${last}`);

// ---- corrections

/** Do something on the server that began at a time of the page's clock, such as the release of a joint. */
async function change(path, body = {}, begin = performance.now()) {
  at('saved').textContent = 'saving…';
  const moving = pulled;
  asking += 1;
  try {
    const found = await ask(path, body);
    if (found.rows) {
      found.rows.forEach((index, k) => {
        data.points[index] = found.points[k];
        data.uv[index] = found.uv[k];
      });
    }
    for (const key of ['version', 'edits', 'undo', 'redo', 'refining', 'fault']) data[key] = found[key];
    if (pulled === moving) pulled = null; // or else the next is moved already
    film.redraw(); // the overlay first: what else shows the motion can wait for it
    sent = Math.round((await painted()) - begin);
    window.studio.sent = sent;
    hush();
    scene.show(film.index);
    lists();
  } catch (error) {
    if (pulled === moving) pulled = null;
    film.redraw();
    lists(error.refused ? 'saved' : 'not saved');
    announce(error.message);
  }
  asking -= 1;
  refresh();
}

/** When what was drawn last is on the screen. */
const painted = () => new Promise((done) => {
  requestAnimationFrame(() => setTimeout(() => done(performance.now())));
});

/** A click is as exact as it can be pointed at on the screen. */
const exact = () => Math.max(0.5, CLICK / film.picture.scale);

function pull({ joint, uv, index = film.index }, begin) {
  return change('/edit', { do: 'pull', frame: frameOf(index), joint: data.joints[joint], uv, sd_px: exact() }, begin);
}

function nearestJoint(place, allowed = () => true) {
  let best = -1, least = Infinity;
  data.uv?.[film.index]?.forEach((uv, j) => {
    const [x, y] = film.picture.toScreen(uv), off = Math.hypot(x - place[0], y - place[1]);
    if (off < least && allowed(data.joints[j])) [best, least] = [j, off];
  });
  return [best, least];
}

function hover(event) {
  const place = film.picture.at(event);
  if (panning) {
    film.picture.panBy(event.clientX - panning[0], event.clientY - panning[1]);
    panning = [event.clientX, event.clientY];
    return;
  }
  if (placing) {
    placing[1] = film.picture.toPicture(place);
    film.redraw();
    return;
  }
  if (pulled && event.buttons & 1) {
    pulled.uv = film.picture.toPicture(place);
    pulled.moved = true;
    film.redraw();
    return;
  }
  const [joint, off] = nearestJoint(place);
  const found = off < NEAR ? joint : -1;
  if (found !== over) {
    over = found;
    film.picture.canvas.classList.toggle('over', over >= 0 && tool === 'pull');
    film.redraw();
  }
}

function press(event) {
  if (event.button !== 0 && event.button !== 1) return;
  film.pause();
  hush();
  const { canvas } = film.picture, place = film.picture.at(event);
  const [joint, off] = nearestJoint(place);
  if (tool === 'pin' && event.button === 0) {
    const [foot] = nearestJoint(place, (name) => /(toe|heel|ankle)$/.test(name));
    if (foot >= 0) {
      change('/edit', { do: 'pin', frame: frameOf(film.index), joint: data.joints[foot], uv: film.picture.toPicture(place), sd_px: exact() });
      choose('pull');
    }
    return;
  }
  canvas.setPointerCapture(event.pointerId);
  if (tool === 'start' && event.button === 0) {
    placing = [film.picture.toPicture(place), film.picture.toPicture(place)];
  } else if (event.button === 0 && off < NEAR) {
    select(joint);
    pulled = { joint, uv: data.uv[film.index][joint], moved: false };
    canvas.classList.add('pulling');
  } else {
    panning = [event.clientX, event.clientY];
  }
  film.redraw();
}

function release(event) {
  film.picture.canvas.classList.remove('pulling');
  panning = null;
  if (placing) {
    const [from, to] = placing;
    placing = null;
    choose('pull');
    ask('/start', { frame: frameOf(film.index), from, to }).then((found) => {
      data.start = found.start;
      lists();
      film.redraw();
    }, (error) => { film.redraw(); announce(error.message); }).finally(refresh);
    return;
  }
  if (!pulled) return;
  if (pulled.moved) pull(pulled, event.timeStamp);
  else drop();
}

/** A right click removes the correction under it. */
function remove(event) {
  event.preventDefault();
  const place = film.picture.at(event), frame = frameOf(film.index);
  const near = (uv) => Math.hypot(...film.picture.toScreen(uv).map((x, k) => x - place[k])) < NEAR;
  const [joint, off] = nearestJoint(place);
  const name = off < NEAR ? data.joints[joint] : null;
  for (const list of ['corrections', 'floor']) {
    const index = (data.edits[list] ?? []).findIndex((c) => c.frame === frame && (c.joint === name || near(c.uv)));
    if (index >= 0) return void change('/edit', { do: 'remove', list, index });
  }
  const index = (data.edits.hidden ?? []).findIndex((h) => h.joint === name && h.first <= frame && frame <= h.last);
  if (index >= 0) change('/edit', { do: 'remove', list: 'hidden', index });
  else announce('There is no correction here.', 2);
}

/** Whether there is such a tool here; the page states why not. */
function allowed(name) {
  if (name in data.without) announce(`${data.without[name]}.`);
  return !(name in data.without);
}

function hide() {
  if (!allowed('hide')) return;
  const [first, last] = marked() ?? [frameOf(film.index), frameOf(film.index)];
  change('/edit', { do: 'hide', joint: data.joints[chosen], first, last });
}

function swap() {
  if (!allowed('swap')) return;
  const found = marked();
  if (!found) return announce('Mark a range first: “From” (I) at its first frame, “To” (O) at its last.');
  change('/edit', { do: 'swap', first: found[0], last: found[1] });
  mark(null, null);
}

function marked() {
  const [a, b] = range;
  return a === null || b === null ? null : [Math.min(a, b), Math.max(a, b)];
}

function mark(first, last) {
  range = [first, last];
  at('range').textContent = first === null && last === null ? '' : `${first ?? '…'} – ${last ?? '…'}`;
}

/** Move the chosen joint by keys; it is sent when they rest. */
function nudge(du, dv) {
  const index = film.index;
  if (timer && (pulled?.joint !== chosen || pulled.index !== index)) send(); // of another joint or frame
  const from = timer && pulled ? pulled.uv : data.uv[index]?.[chosen];
  if (!from) return;
  pulled = { joint: chosen, uv: [from[0] + du, from[1] + dv], moved: true, index };
  film.redraw();
  clearTimeout(timer);
  timer = setTimeout(send, WAIT);
}

/** Send what the keys moved, in the frame in which they moved it. */
function send() {
  clearTimeout(timer);
  timer = 0;
  if (pulled) pull(pulled);
}

// ---- getting about

function select(joint) {
  chosen = joint;
  at('joint').value = joint;
  film.redraw();
}

function go(frame, joint) {
  film.pause();
  film.seek(indexOf(frame));
  if (joint) select(data.joints.indexOf(joint));
}

function propose(k) {
  if (!data.proposals.length) return announce('There are no suggestions.', 2);
  proposal = k % data.proposals.length;
  const { frame, joint } = data.proposals[proposal];
  go(frame, joint);
  const uv = data.uv[film.index]?.[chosen];
  if (uv) film.picture.look(uv, Math.max(film.picture.zoom, near()));
  announce(`${words(joint)}, frame ${frame}: drag it to where you see it.`, 3);
}

function choose(name) {
  if (!allowed(name)) return;
  tool = name;
  for (const each of ['pull', 'pin', 'start']) at(`tool-${each}`).setAttribute('aria-pressed', each === name);
  if (name === 'start') announce('Drag over the floor, from below the person in the direction of walking.', 3);
  if (name === 'pin') announce('Click the floor where a heel, toe or ankle stands.', 3);
}

const KEYS = {
  ' ': () => film.toggle(),
  n: () => propose(proposal + 1),
  d: () => choose('pull'),
  f: () => choose('pin'),
  b: () => choose('start'),
  h: hide,
  i: () => mark(frameOf(film.index), range[1]),
  o: () => mark(range[0], frameOf(film.index)),
  s: swap,
  '+': () => film.picture.zoomBy(1.25),
  '=': () => film.picture.zoomBy(1.25),
  '-': () => film.picture.zoomBy(0.8),
  z: () => follow(!following),
  0: () => follow(false),
  '?': () => at('helping').showModal(),
  Escape: () => choose('pull'),
};
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

document.addEventListener('keydown', (event) => {
  if (!data || at('helping').open) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const arrow = ARROWS[event.key];
  if ((event.ctrlKey || event.metaKey) && (key === 'z' || key === 'y')) {
    event.preventDefault();
    change(key === 'y' || event.shiftKey ? '/redo' : '/undo');
  } else if (arrow && event.altKey) {
    event.preventDefault();
    nudge(...arrow);
  } else if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('select, input[type=number]')) {
    return;
  } else if (arrow && arrow[0] && !event.target.matches('.scene canvas')) {
    event.preventDefault();
    film.step(arrow[0] * (event.shiftKey ? 10 : 1));
  } else if (KEYS[key] && !(key === ' ' && event.target.matches('button, summary'))) {
    event.preventDefault();
    KEYS[key]();
  }
});

at('undo').addEventListener('click', () => change('/undo'));
at('redo').addEventListener('click', () => change('/redo'));
at('hide').addEventListener('click', hide);
at('follow').addEventListener('click', () => follow(!following));
at('swap').addEventListener('click', swap);
at('from').addEventListener('click', KEYS.i);
at('to').addEventListener('click', KEYS.o);
at('tool-pull').addEventListener('click', () => choose('pull'));
at('tool-start').addEventListener('click', () => choose('start'));
at('tool-pin').addEventListener('click', () => choose('pin'));
at('joint').addEventListener('change', () => select(Number(at('joint').value)));
at('help').addEventListener('click', () => at('helping').showModal());
at('helping').addEventListener('close', () => {
  localStorage.setItem('gait studio: helped', 'yes');
  document.activeElement?.blur();
});
// After a click by mouse the space bar plays again; who presses buttons by keys keeps them.
document.addEventListener('click', (event) => {
  if (event.detail > 0) event.target.closest?.('button')?.blur();
});
at('copy').addEventListener('click', () => navigator.clipboard.writeText(data.command).then(
  () => announce(`Copied: ${data.command}`), () => announce(data.command, 20)));
at('export').addEventListener('change', async () => {
  const kind = at('export').value;
  at('export').value = '';
  if (!kind) return;
  const answer = await fetch(`/export/${kind}`);
  if (!answer.ok) return announce((await answer.json()).error);
  const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(await answer.blob()) });
  link.download = /filename="?([^"]+)"?/.exec(answer.headers.get('content-disposition') ?? '')?.[1] ?? `motion.${kind}`;
  link.click();
});

// ---- begin

await load();
if (!localStorage.getItem('gait studio: helped')) at('helping').showModal();
const changes = new EventSource('/changes');
changes.addEventListener('message', (event) => { reported = Number(event.data); refresh(); });
changes.addEventListener('error', () => {
  data.version = -1; // of a server that may be another one when it runs again
  at('saved').textContent = 'no connection to gait studio; it goes on when that runs again';
});
