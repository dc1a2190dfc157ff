// The film with timeline, step, play and zoom, and a canvas over it.

const STEPS = 1.25; // zoom of a notch of the wheel

/** A picture that can be zoomed and moved, with a canvas over it; its source is a video, an image or nothing. */
export class Picture {
  /**
   * @param {HTMLElement} element  filled by the stage
   * @param {HTMLElement} media    video or img
   * @param {number[]} size        of the picture, pixels
   * @param {function} paint       called with (context, view) to draw over the picture; `view.toScreen([u, v])`
   */
  constructor(element, media, size, paint) {
    this.media = media;
    this.size = size;
    this.paint = paint;
    this.zoom = 1;
    this.middle = [size[0] / 2, size[1] / 2];
    element.classList.add('stage');
    this.canvas = document.createElement('canvas');
    element.append(media, this.canvas);
    Object.assign(media.style, { width: `${size[0]}px`, height: `${size[1]}px` });
    this.sized = new ResizeObserver(() => this.redraw());
    this.sized.observe(element);
    this.canvas.addEventListener('wheel', (event) => this.#wheel(event), { passive: false });
    this.element = element;
  }

  /** Screen pixels for a picture's pixel. */
  get scale() {
    const { clientWidth: wide, clientHeight: high } = this.element;
    return Math.min(wide / this.size[0], high / this.size[1]) * this.zoom || 1;
  }

  toScreen([u, v]) {
    const s = this.scale;
    return [this.element.clientWidth / 2 + (u - this.middle[0]) * s, this.element.clientHeight / 2 + (v - this.middle[1]) * s];
  }

  toPicture([x, y]) {
    const s = this.scale;
    return [this.middle[0] + (x - this.element.clientWidth / 2) / s, this.middle[1] + (y - this.element.clientHeight / 2) / s];
  }

  /** Place of an event of the pointer, in screen pixels of the stage. */
  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Zoom by a factor, keeping a screen point where it is. */
  zoomBy(factor, about = [this.element.clientWidth / 2, this.element.clientHeight / 2]) {
    const held = this.toPicture(about);
    this.zoom = Math.min(20, Math.max(1, this.zoom * factor));
    const moved = this.toPicture(about);
    this.#move([this.middle[0] + held[0] - moved[0], this.middle[1] + held[1] - moved[1]]);
  }

  /** Move the picture by screen pixels. */
  panBy(dx, dy) {
    this.#move([this.middle[0] - dx / this.scale, this.middle[1] - dy / this.scale]);
  }

  /** Show the whole picture. */
  fit() {
    this.look([this.size[0] / 2, this.size[1] / 2], 1);
  }

  /** Show a pixel in the middle, at a zoom, or as near to it as the picture fills the stage. */
  look(middle, zoom = this.zoom) {
    this.zoom = Math.min(20, Math.max(1, zoom));
    const half = [this.element.clientWidth, this.element.clientHeight].map((length) => length / 2 / this.scale);
    this.#move(middle.map((m, k) => (2 * half[k] < this.size[k] ? Math.min(this.size[k] - half[k], Math.max(half[k], m)) : this.size[k] / 2)));
  }

  #move(middle) {
    this.middle = this.zoom === 1 ? this.size.map((n) => n / 2) : middle.map((m, k) => Math.min(this.size[k], Math.max(0, m)));
    this.redraw();
  }

  #wheel(event) {
    event.preventDefault();
    this.zoomBy(event.deltaY < 0 ? STEPS : 1 / STEPS, this.at(event));
  }

  redraw() {
    const { clientWidth: wide, clientHeight: high } = this.element, ratio = devicePixelRatio;
    if (!wide || !high) return;
    if (this.canvas.width !== Math.round(wide * ratio) || this.canvas.height !== Math.round(high * ratio)) {
      this.canvas.width = Math.round(wide * ratio);
      this.canvas.height = Math.round(high * ratio);
    }
    // The middle of the top left pixel is (0, 0): its corner is half a pixel before.
    const [left, top] = this.toScreen([-0.5, -0.5]);
    this.media.style.transform = `translate(${left}px, ${top}px) scale(${this.scale})`;
    const context = this.canvas.getContext('2d');
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, wide, high);
    this.paint(context, this);
  }

  dispose() {
    this.sized.disconnect();
  }
}

/** A film whose frame k is shown from k / rate to (k + 1) / rate seconds of a video. */
export class Film {
  /**
   * @param {HTMLElement} element  filled by stage and bar
   * @param {object} data          see motion_data.py: rate, times, size, events
   * @param {string} source        URL of the video; its frames are those of `data`
   * @param {function} paint       called with (context, picture, index) to draw over a frame
   * @param {function} moved       called with the index whenever another frame is shown
   */
  constructor(element, data, source, paint, moved) {
    this.data = data;
    this.moved = moved;
    this.index = 0;
    element.classList.add('film');
    this.video = Object.assign(document.createElement('video'), { src: source, muted: true, playsInline: true, preload: 'auto' });
    this.video.setAttribute('aria-label', 'The film');
    const stage = document.createElement('div');
    element.append(stage);
    this.picture = new Picture(stage, this.video, data.size, (context, picture) => paint(context, picture, this.index));
    this.#bar(element);
    this.video.addEventListener('seeked', () => this.#show(this.index));
    this.video.addEventListener('loadeddata', () => this.seek(this.index));
    // A busy browser may announce no single frame: then by its clock, four times a second.
    this.video.addEventListener('timeupdate', () => { if (this.playing) this.#at(this.video.currentTime); });
    this.video.addEventListener('ended', () => {
      this.#at(this.video.currentTime);
      this.pause();
    });
    this.video.addEventListener('error', () => this.#broken());
    this.setData(data);
  }

  get count() {
    return this.data.times.length;
  }

  get playing() {
    return !this.video.paused && !this.video.ended;
  }

  setData(data) {
    this.data = data;
    this.slider.max = this.count - 1;
    this.#marks();
    this.picture.redraw();
  }

  /** Show a frame, by its index. */
  seek(index) {
    const wanted = Math.min(this.count - 1, Math.max(0, Math.round(index)));
    this.video.currentTime = (wanted + (this.data.offset ?? 0) + 0.5) / this.data.rate;
    this.#show(wanted);
  }

  step(frames) {
    this.pause();
    this.seek(this.index + frames);
  }

  play() {
    if (this.index >= this.count - 1) this.seek(0);
    this.video.play().then(() => this.#each(), () => {});
    this.button.textContent = '❚❚';
    this.button.setAttribute('aria-label', 'Pause');
  }

  pause() {
    this.video.pause();
    this.button.textContent = '▶';
    this.button.setAttribute('aria-label', 'Play');
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  redraw() {
    this.picture.redraw();
  }

  /** Follow the video while it plays: one call for each frame that is shown. */
  #each() {
    this.video.requestVideoFrameCallback((_, { mediaTime }) => {
      this.#at(mediaTime);
      if (this.playing) this.#each();
    });
  }

  /** Show the frame of a time of the video, which it reached by playing. */
  #at(seconds) {
    const shown = Math.floor(seconds * this.data.rate + 0.01) - (this.data.offset ?? 0);
    if (shown >= this.count) this.pause();
    this.#show(Math.max(0, Math.min(this.count - 1, shown)));
  }

  #show(index) {
    this.index = index;
    this.slider.value = index;
    const status = this.data.status?.[index];
    this.clock.textContent = `${(this.data.times[index] ?? 0).toFixed(2)} s · frame ${index + (this.data.first ?? 0)}${status ? ` · ${status}` : ''}`;
    this.slider.setAttribute('aria-valuetext', this.clock.textContent);
    this.picture.redraw();
    this.moved?.(index);
  }

  #bar(element) {
    const bar = document.createElement('div');
    bar.className = 'bar';
    const add = (text, label, press) => {
      const button = Object.assign(document.createElement('button'), { type: 'button', textContent: text, title: label });
      button.setAttribute('aria-label', label);
      button.addEventListener('click', press);
      bar.append(button);
      return button;
    };
    add('◀', 'One frame back', () => this.step(-1));
    this.button = add('▶', 'Play', () => this.toggle());
    add('▶|', 'One frame on', () => this.step(1));
    const track = document.createElement('div');
    track.className = 'track';
    this.marks = document.createElement('div');
    this.marks.className = 'marks';
    this.slider = Object.assign(document.createElement('input'), { type: 'range', min: 0, step: 1, value: 0 });
    this.slider.setAttribute('aria-label', 'Frame of the film');
    this.slider.addEventListener('input', () => {
      this.pause();
      this.seek(Number(this.slider.value));
    });
    this.strip = document.createElement('canvas');
    this.strip.className = 'strip';
    this.strip.height = 1;
    this.strip.title = 'The stronger the colour, the less certain';
    track.append(this.strip, this.slider, this.marks);
    bar.append(track);
    this.clock = document.createElement('span');
    this.clock.className = 'number faint';
    bar.append(this.clock);
    this.speed = document.createElement('select');
    this.speed.setAttribute('aria-label', 'Speed');
    for (const rate of [1, 0.5, 0.25, 0.1]) this.speed.append(new Option(`${rate}×`, rate));
    this.speed.addEventListener('change', () => { this.video.playbackRate = Number(this.speed.value); });
    bar.append(this.speed);
    add('⤢', 'Show the whole picture', () => this.picture.fit());
    element.append(bar);
    this.bar = bar;
  }

  /** Marks of events, and the strip of how uncertain each frame is. */
  #marks() {
    const { strip } = this.data, context = this.strip.getContext('2d');
    this.strip.width = this.count;
    if (strip) {
      const most = Math.max(...strip.filter(Number.isFinite), 1e-9);
      context.fillStyle = getComputedStyle(this.strip).color;
      strip.forEach((value, k) => { context.globalAlpha = (value ?? 0) / most; context.fillRect(k, 0, 1, 1); });
    }
    const [start, end] = [this.data.times[0], this.data.times.at(-1)];
    this.marks.replaceChildren(...(this.data.events ?? []).map((event) => {
      const mark = document.createElement('i');
      mark.title = event.name;
      mark.style.left = `${(100 * (event.time - start)) / Math.max(end - start, 1e-9)}%`;
      if (event.side) mark.style.background = `var(--${event.side})`;
      return mark;
    }));
  }

  #broken() {
    this.clock.textContent = 'the video cannot be played by this browser';
  }
}
