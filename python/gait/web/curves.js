// Plots under the film: curves by time with their 90 % intervals, linked to the film's cursor.
import { colour } from 'gait/scene.js';

const DASH = { left: 'solid', right: 'dashed', '': 'solid' };
const GRID = { left: 44, right: 18, top: 10, bottom: 20 };

export class Curves {
  /**
   * @param {HTMLElement} element  filled by the plots
   * @param {object} data          see motion_data.py: times, curves
   * @param {function} seek        called with the index of a frame that is clicked
   */
  constructor(element, data, seek) {
    this.element = element;
    this.seek = seek;
    this.index = 0;
    element.classList.add('curves');
    this.plots = [];
    this.sized = new ResizeObserver(() => {
      this.plots.forEach((plot) => plot.chart.resize());
      this.show(this.index);
    });
    this.sized.observe(element);
    this.dark = matchMedia('(prefers-color-scheme: dark)');
    this.dark.addEventListener('change', (this.recolour = () => this.setData(this.data)));
    this.setData(data);
  }

  /** Draw other curves; plots of the same names stay where they are. */
  setData(data) {
    this.data = data;
    const names = [...new Set((data.curves ?? []).map((curve) => curve.name))];
    if (names.join() !== this.plots.map((plot) => plot.name).join()) {
      this.plots.forEach((plot) => plot.chart.dispose());
      this.element.replaceChildren();
      this.plots = names.map((name) => this.#plot(name));
      this.plots.forEach((plot) => plot.chart.resize()); // all share the width, which the first had alone
    }
    this.plots.forEach((plot) => this.#fill(plot));
    this.show(this.index);
  }

  /** Append frames: `times`, and `curves` with values (and low, high) of the new frames by id. */
  append(more, keep = Infinity) {
    this.data.times.push(...more.times);
    for (const curve of this.data.curves) {
      const found = more.curves.find((each) => each.id === curve.id);
      for (const key of ['values', 'low', 'high']) if (curve[key] && found?.[key]) curve[key].push(...found[key]);
    }
    const left = this.data.times.length - keep;
    if (left > 0) {
      this.data.times.splice(0, left);
      for (const curve of this.data.curves) for (const key of ['values', 'low', 'high']) curve[key]?.splice(0, left);
    }
    this.setData(this.data);
  }

  /** Move the cursor to a frame. */
  show(index) {
    this.index = index;
    const time = this.data.times[index];
    for (const plot of this.plots) {
      const x = time === undefined ? -10 : plot.chart.convertToPixel({ xAxisIndex: 0 }, time);
      plot.cursor.style.left = `${(Number.isFinite(x) ? x : -10) - 1}px`;
    }
  }

  dispose() {
    this.sized.disconnect();
    this.dark.removeEventListener('change', this.recolour);
    this.plots.forEach((plot) => plot.chart.dispose());
  }

  #plot(name) {
    const figure = document.createElement('figure'), caption = document.createElement('figcaption');
    const place = document.createElement('div'), cursor = document.createElement('div');
    place.className = 'plot';
    place.setAttribute('role', 'img'); // ECharts gives it its label
    cursor.className = 'cursor';
    figure.append(caption, place, cursor);
    this.element.append(figure);
    const chart = window.echarts.init(place, null, { renderer: 'canvas' });
    chart.getZr().on('click', (event) => {
      const [time] = chart.convertFromPixel({ gridIndex: 0 }, [event.offsetX, event.offsetY]);
      this.seek?.(nearest(this.data.times, time));
    });
    return { name, chart, caption, cursor, figure };
  }

  #fill(plot) {
    const curves = this.data.curves.filter((curve) => curve.name === plot.name);
    plot.caption.replaceChildren(`${plot.name}${curves[0].unit ? ` (${curves[0].unit})` : ''} `, ...key(curves));
    const text = { color: colour('faint') }, line = { lineStyle: { color: colour('grid') } };
    plot.chart.setOption({
      animation: false,
      aria: { enabled: true, label: { description: `${plot.name} by time${curves.some((curve) => curve.low) ? ', with 90 % intervals' : ''}` } },
      grid: GRID,
      tooltip: { trigger: 'axis', confine: true, valueFormatter: (value) => (value === null || value === undefined ? '–' : value.toFixed(1)) },
      xAxis: { type: 'value', min: this.data.times[0], max: this.data.times.at(-1), axisLabel: { ...text, showMinLabel: this.data.times[0] === 0, showMaxLabel: false, formatter: (value) => `${Math.round(value * 100) / 100} s` }, splitLine: { show: false }, axisLine: line },
      yAxis: { type: 'value', scale: true, ...limits(curves[0]), splitNumber: 3, axisLabel: text, splitLine: line },
      series: curves.flatMap((curve) => this.#series(curve)),
    }, { notMerge: true });
  }

  /** Line of a curve and, as polygons, its interval. */
  #series(curve) {
    const ink = colour(curve.side || 'middle'), times = this.data.times;
    const pairs = (values) => values.map((value, k) => [times[k], value]);
    const plain = { type: 'line', symbol: 'none', silent: true, sampling: 'lttb' };
    const found = [{ ...plain, name: curve.side || curve.name, data: pairs(curve.values), color: ink,
      lineStyle: { color: ink, width: 2, type: DASH[curve.side ?? ''] }, z: 3 }];
    if (curve.low && curve.high) {
      const style = { fill: ink, opacity: Number(colour('band')) };
      found.push({ type: 'custom', silent: true, tooltip: { show: false }, clip: true, z: 1,
        dimensions: ['time', 'low', 'high'], encode: { x: 0, y: [1, 2] },
        data: times.map((time, k) => [time, curve.low[k], curve.high[k]]),
        // Drawn whole with the first point, because the parts between points would show seams.
        renderItem: (params, api) => params.dataIndexInside === 0 && { type: 'group', children: runs(curve).map((run) => ({
          type: 'polygon', style, silent: true,
          shape: { points: [...run.map((k) => api.coord([times[k], curve.high[k]])),
            ...run.toReversed().map((k) => api.coord([times[k], curve.low[k]]))] } })) } });
    }
    return found;
  }
}

/** Runs of indices where an interval is known. */
function runs(curve) {
  const found = [[]];
  curve.low.forEach((low, k) => {
    if (low !== null && curve.high[k] !== null) found.at(-1).push(k);
    else if (found.at(-1).length) found.push([]);
  });
  return found.filter((run) => run.length > 1);
}

/** Sides of the curves of a plot, in words with a piece of line. */
function key(curves) {
  return curves.filter((curve) => curve.side).map((curve) => {
    const mark = document.createElement('span');
    mark.className = curve.side;
    mark.textContent = `${curve.side === 'left' ? '—' : '- -'} ${curve.side} `;
    return mark;
  });
}

/** Index of the time nearest to one. */
export function nearest(times, time) {
  let best = 0;
  times.forEach((each, k) => { if (Math.abs(each - time) < Math.abs(times[best] - time)) best = k; });
  return best;
}

/** Bounds of an axis, with a line between them; empty where they follow the values. */
function limits({ limits: bounds }) {
  return bounds ? { min: bounds[0], max: bounds[1], interval: (bounds[1] - bounds[0]) / 2 } : {};
}
