// The live page: pictures, figure, numbers and plots of the tracker as it runs.
const element = (id) => document.getElementById(id);
const DRAW_MS = 250; // between two drawings of the plots
const SLOW_DRAW_MS = 1000; // the same where the processor draws the page
const GAP = 1; // seconds without an estimate that no line crosses
const KEPT = 1200; // samples
const QUIET_MS = 6000; // without an estimate the page reports that there is none
const TEXT = { tracking: 'tracking', ambiguous: 'uncertain', lost: 'lost', init: 'settling' };

const start = await (await fetch('/state')).json();
let scene, curves, software = false, paused = false, recording = Boolean(start.recording.path);
let chosen = 0; // person whose numbers and plots are shown
const PHASE = start.curves.findIndex((curve) => curve.name === 'phase');
const people = start.people.map((one) => ({ ...one, last: 0, heard: -Infinity, health: null, body: null }));

// ---- figure and plots, where their parts were fetched ----
if (start.parts) {
  const [{ Scene, SOFTWARE }, { Curves }] = await Promise.all([import('gait/scene.js'), import('gait/curves.js')]);
  software = SOFTWARE;
  scene = new Scene(element('scene'), { ...start, times: [], points: [], sd: [] }, software);
  curves = new Curves(element('curves'), { times: [], curves: start.curves });
  curves.show(-1); // no cursor: the plots end now
} else {
  element('scene').innerHTML = '<p class="none">The figure and the plots need components that were not downloaded: run gait studio --fetch once, with a network connection.</p>';
}

let waiting = [], drawn = null;

/** Samples with breaks of lines: where estimates are missing, and where the phase begins again. */
function broken(samples) {
  return samples.flatMap((one) => {
    const before = drawn;
    drawn = one;
    if (before && one.time - before.time > GAP) return [{ ...before, values: one.values.map(() => null) }, one];
    return [{ ...one, values: one.values.map((value, k) => (before && k === PHASE && before.values[k] - value > 0.5 ? null : value)) }];
  });
}

function draw() {
  if (document.hidden) return;
  const found = broken(waiting);
  waiting = [];
  if (paused || !curves || !found.length) return;
  curves.append({
    times: found.map((one) => one.time),
    curves: start.curves.map((curve, k) => ({ id: curve.id, values: found.map((one) => one.values[k]) })),
  }, Math.round(start.seconds * Math.max(5, found.at(-1).rate ?? 30)));
  scene.append({});
}

/** A function that calls another at once, but at most so often, milliseconds; what is asked for meanwhile is done later. */
function atMost(period, act) {
  let asked = 0, last = -Infinity;
  return () => {
    asked ||= setTimeout(() => {
      asked = 0;
      last = performance.now();
      act();
    }, Math.max(last + period - performance.now(), 0));
  };
}
const drawSoon = atMost(software ? SLOW_DRAW_MS : DRAW_MS, draw);
const showFigureSoon = atMost(0, () => scene.show(scene.data.times.length - 1));

// ---- people: each has a tracker of its own ----
function choose(who) {
  chosen = who;
  drawn = null;
  people.forEach((one, k) => one.button?.setAttribute('aria-pressed', k === who));
  waiting = [];
  element('list').replaceChildren();
  for (const name of Object.keys(numbers)) delete numbers[name];
  if (!scene) return;
  for (const curve of start.curves) curve.values.length = 0;
  curves.setData({ times: [], curves: start.curves });
  for (const key of ['times', 'points', 'sd']) scene.data[key].length = 0;
  showOthers();
}

function showOthers() {
  const now = performance.now();
  scene?.showOthers(people.filter((one, k) => k !== chosen && one.body && now - one.last < QUIET_MS).map((one) => one.body));
}

if (people.length > 1) {
  people.forEach((one, k) => {
    one.button = Object.assign(document.createElement('button'), { type: 'button', textContent: `Person ${one.name}`, title: `${one.channel} on ${one.url}` });
    one.button.setAttribute('aria-pressed', k === chosen);
    one.button.addEventListener('click', () => choose(k));
    element('people').append(one.button);
  });
}

// ---- numbers ----
const numbers = {};
function show(name, value) {
  if (!numbers[name]) {
    const box = document.createElement('div'), key = document.createElement('dt'), text = document.createElement('dd');
    key.textContent = name;
    box.append(key, text);
    element('list').append(box);
    numbers[name] = text;
  }
  numbers[name].textContent = value;
}
const unit = (value, digits, name) => (value === null || value === undefined ? '–' : `${value.toFixed(digits)} ${name}`);

function setStatus(status, text) {
  const pill = element('status');
  if (pill.textContent !== text) pill.textContent = text;
  pill.className = `status ${status}`;
}

function onSample(one) {
  const person = people[one.person];
  person.last = performance.now();
  if (paused) return;
  element('waiting').replaceChildren();
  person.body = one.points;
  if (person.button) person.button.textContent = `Person ${person.name}: ${TEXT[one.status] ?? one.status}`;
  if (one.person !== chosen) return showOthers();
  setStatus(one.status, TEXT[one.status] ?? one.status);
  show('cadence', unit(one.cadence, 0, 'steps/min'));
  show('speed', unit(one.speed, 2, 'm/s'));
  if (one.motion) show('motion', one.motion);
  show('rate', unit(one.rate, 1, 'Hz'));
  show('latency', unit(one.latency_ms, 0, 'ms'));
  show('step', unit(one.step_ms, 1, 'ms'));
  show('left/right certainty', `${Math.round(100 * one.sure)} %`);
  show('frame', one.frame < 0 ? '–' : String(one.frame));
  element('hand').toggleAttribute('hidden', one.phase === null);
  if (one.phase !== null) element('hand').setAttribute('transform', `rotate(${360 * one.phase})`);
  waiting.push(one);
  if (waiting.length > KEPT) waiting.shift(); // while the page is hidden
  if (!scene) return;
  const data = scene.data;
  data.times.push(one.time);
  data.points.push(one.points);
  data.sd.push(one.sd);
  if (data.times.length > KEPT) for (const key of ['times', 'points', 'sd']) data[key].shift();
  drawSoon();
  showFigureSoon();
}

function onHealth(one) {
  Object.assign(people[one.person], { health: one, heard: performance.now() });
  if (one.person !== chosen) return;
  element('text').textContent = one.state === 'running' && one.text === 'tracking' ? '' : one.text;
  show('frames dropped', String(one.dropped));
  show('particles', String(one.particles));
  if (quiet()) explain();
}

// ---- what is missing ----
let arrived = -Infinity; // of the newest frames
const quiet = () => performance.now() - people[chosen].last > QUIET_MS;
const answers = () => performance.now() - people[chosen].heard < QUIET_MS;
/** What to do about missing estimates; empty where the state of the tracker explains them. */
function remedy() {
  const { url, channel, name, health } = people[chosen], sent = performance.now() - arrived < QUIET_MS;
  if (answers()) {
    if (sent) return '';
    if (!health.frames) return 'Start gait capture for a film or camera.';
    return health.state === 'running' ? 'No frames arrive any more: the film has ended or the camera stopped.' : '';
  }
  const tracker = channel !== 'GAIT_ESTIMATE' ? `gait-trackd --person ${name} --keypoints-term and gait detect --lcm`
    : url === start.url ? 'gait-trackd on the same URL (--url, or LCM_DEFAULT_URL)' : `gait-trackd --url ${start.url} --out ${url}`;
  return sent ? `Frames arrive, but no tracker answers: start ${tracker}.` : `Start ${tracker}, and gait capture for a film or camera.`;
}
let explained = '';
function explain() {
  if (paused) return;
  setStatus('', 'waiting');
  const images = `GAIT_IMAGE_${start.streams.join(', GAIT_IMAGE_')} on ${start.url}`, { url, channel, health } = people[chosen];
  const lines = [
    answers() ? `The tracker is ${health.text.startsWith(health.state) ? '' : `${health.state}: `}${health.text}.` : 'No estimates arrive.',
    `Listening for ${channel} ${url === start.url ? '' : `on ${url} `}and ${images}.`, remedy()].filter(Boolean);
  if (lines.join() === explained && element('waiting').textContent) return;
  explained = lines.join();
  element('waiting').replaceChildren(...lines.map((line) => Object.assign(document.createElement('p'), { textContent: line })));
}
setInterval(() => { if (quiet()) explain(); }, 500);

// ---- pictures: the newest is fetched when the one before is there ----
const images = new Map();
for (const stream of start.streams) {
  const figure = document.createElement('figure'), image = document.createElement('img');
  image.alt = `Camera ${stream}, with the estimate drawn into its picture`;
  const done = () => {
    image.busy = false;
    if (image.newer) onPicture(stream);
  };
  image.addEventListener('load', done);
  image.addEventListener('error', done);
  image.hidden = true;
  figure.append(image);
  if (start.streams.length > 1) figure.append(Object.assign(document.createElement('figcaption'), { textContent: `camera ${stream}` }));
  element('images').append(figure);
  images.set(stream, image);
}

function onPicture(stream) {
  const image = images.get(stream);
  if (!image || paused) return;
  image.newer = image.busy || document.hidden;
  if (image.newer) return;
  image.busy = true;
  image.hidden = false;
  image.src = `/frame/${stream}.jpg?${Date.now()}`;
}

document.addEventListener('visibilitychange', () => {
  for (const [stream, image] of images) if (image.newer && !image.busy) onPicture(stream);
});

// ---- buttons ----
function message(text) {
  element('message').textContent = text;
  element('message').classList.add('shown');
  setTimeout(() => element('message').classList.remove('shown'), 6000);
}

function pause() {
  paused = !paused;
  element('pause').setAttribute('aria-pressed', paused);
}

/** The pictures as they are shown. */
function snapshot() {
  for (const [stream, image] of images) {
    if (!image.naturalWidth) continue;
    const canvas = Object.assign(document.createElement('canvas'), { width: image.naturalWidth, height: image.naturalHeight });
    canvas.getContext('2d').drawImage(image, 0, 0);
    Object.assign(document.createElement('a'), { href: canvas.toDataURL('image/png'), download: `gait-camera-${stream}.png` }).click();
  }
}

function showRecording(on) {
  recording = on;
  element('record').setAttribute('aria-pressed', on);
  element('record').textContent = on ? 'Stop recording' : 'Record';
}
async function record() {
  const answer = await (await fetch(`/record?on=${recording ? 0 : 1}`, { method: 'POST' })).json();
  if (answer.error) message(answer.error);
}
function onRecording(one) {
  if (one.fault) message(`${one.path} is not complete: ${one.fault}`);
  else if (one.path && !recording) message(`Recording into ${one.path}`);
  else if (!one.path && recording) message(`Recorded in ${recorded}`);
  recorded = one.path ?? recorded;
  showRecording(Boolean(one.path) && !one.fault);
}
let recorded = start.recording.path;
showRecording(recording);
element('pause').addEventListener('click', pause);
element('snapshot').addEventListener('click', snapshot);
element('record').addEventListener('click', record);
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest('button, input, select')) return;
  const press = { ' ': pause, s: snapshot, r: record }[event.key.toLowerCase?.() ?? event.key];
  if (press) {
    event.preventDefault();
    press();
  }
});

// ---- events; a browser connects again by itself ----
const events = new EventSource('/events');
events.addEventListener('sample', (event) => onSample(JSON.parse(event.data)));
events.addEventListener('health', (event) => onHealth(JSON.parse(event.data)));
events.addEventListener('frames', () => { arrived = performance.now(); });
events.addEventListener('picture', (event) => onPicture(Number(event.data)));
events.addEventListener('recording', (event) => onRecording(JSON.parse(event.data)));
events.addEventListener('error', () => setStatus('away', 'gait view is not there'));
window.live = { get scene() { return scene; }, get curves() { return curves; }, start };
