// The page of a run: the film, the figure that turns and plays with it, plots with a cursor.
import { Film } from 'gait/film.js';

const element = (id) => document.getElementById(id);
const data = JSON.parse(element('run-data').textContent);
const bytes = Uint8Array.from(atob(element('run-film').textContent.trim()), (c) => c.charCodeAt(0));
const source = URL.createObjectURL(new Blob([bytes], { type: 'video/mp4' }));

let scene, curves;
if (data.parts) {
  const [{ Scene }, { Curves }] = await Promise.all([import('gait/scene.js'), import('gait/curves.js')]);
  scene = new Scene(element('run-figure'), data);
  if (data.vague) [...element('run-figure').querySelectorAll('button')].find((one) => one.textContent === 'Uncertainty')?.click();
  if (data.curves.length) curves = new Curves(element('run-curves'), data, (index) => film.seek(index));
}

/** Cursors: at a share of a strip of the page, or between the axes' sides of a plot over time. */
const cursors = [];
const cursor = (place, share) => {
  const line = document.createElement('div');
  line.className = 'cursor';
  place.append(line);
  cursors.push((time, index) => { line.style.left = `${100 * share(time, index)}%`; });
};
cursor(element('run-statuses'), (_, index) => (index + 0.5) / data.times.length);
for (const plot of document.querySelectorAll('.over-time')) {
  const from = Number(plot.dataset.from), to = Number(plot.dataset.to);
  for (const one of plot.querySelectorAll('.timed')) {
    const left = Number(one.dataset.left), right = Number(one.dataset.right);
    cursor(one, (time) => left + (right - left) * Math.min(1, Math.max(0, (time - from) / (to - from))));
    one.addEventListener('click', (event) => {
      const box = one.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - left) / (right - left);
      const time = from + share * (to - from);
      film.seek(data.times.findLastIndex((each) => each <= time));
    });
  }
}

const film = new Film(element('run-video'), data, source, () => {}, (index) => {
  scene?.show(index);
  curves?.show(index);
  cursors.forEach((move) => move(data.times[index], index));
});
film.video.addEventListener('loadeddata', () => film.seek(data.begin), { once: true });
document.addEventListener('keydown', (event) => {
  if (event.target.closest('input, select, button, summary')) return;
  const press = { ' ': () => film.toggle(), ArrowLeft: () => film.step(-1), ArrowRight: () => film.step(1) }[event.key];
  if (press) {
    event.preventDefault();
    press();
  }
});
window.run = { film, scene, curves, data };
