// The live picture: tiles of shared-exponent pixels, shown with an exposure or as false color, to pan and zoom.
import {h, put, small} from './dom.js';

const kTile = 256;
const kFetches = 4;  // at a time; a browser has six connections to one server

// Display value of a linear one, by a table: sRGB.
const kSteps = 8192;
const kSrgb = new Uint8Array(kSteps + 1);
for (let i = 0; i <= kSteps; ++i) {
  const v = (i / kSteps) ** 2;
  kSrgb[i] = Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
}

// Inferno, from black over purple and orange to yellow.
const kStops = [[0, 0, 4], [40, 11, 84], [101, 21, 110], [159, 42, 99], [212, 72, 66], [245, 125, 21], [250, 193, 39], [252, 255, 164]];
const kColors = new Uint8Array(3 * 256);
for (let i = 0; i < 256; ++i) {
  const t = (i / 255) * (kStops.length - 1), k = Math.min(Math.floor(t), kStops.length - 2);
  for (let c = 0; c < 3; ++c) kColors[3 * i + c] = kStops[k][c] + (t - k) * (kStops[k + 1][c] - kStops[k][c]);
}
const kDecades = 3;  // of relative error that false color shows

export class Viewer {
  constructor(job, kind) {
    this.job = job;
    this.kind = kind;
    this.exposure = 0;
    this.levels = [];
    this.tiles = new Map();  // 'level/x/y': {etag, data}
    this.sheets = new Map();  // by level: a canvas of the whole picture
    this.scale = 0;  // screen pixels an image pixel; 0: fit
    this.center = [0.5, 0.5];  // of the view, as share of the image
    this.cursor = null;
    this.queue = [];
    this.running = 0;
    this.serial = 0;

    this.canvas = h('canvas', {tabindex: 0, role: 'img', 'aria-describedby': 'viewer-keys'});
    this.empty = h('p', {class: 'empty'}, 'Waiting for the first iterations.');
    this.readout = h('output', {class: 'readout', 'aria-label': 'Pixel values'}, '');
    this.exposureText = h('output', {}, '0.0');
    this.slider = h('input', {type: 'range', min: -10, max: 10, step: 0.1, value: 0, id: 'exposure', oninput: () => this.setExposure(Number(this.slider.value))});
    const button = (text, label, f) => h('button', {type: 'button', 'aria-label': label, title: label, onclick: f}, text);
    this.zoomText = h('output', {class: 'zoom', 'aria-label': 'Zoom'}, '');
    const kinds = h('select', {'aria-label': 'Picture', onchange: () => this.onkind(kinds.value)},
        h('option', {value: 'image', selected: kind === 'image'}, 'Image'), h('option', {value: 'error', selected: kind === 'error'}, 'Error map'));
    this.element = h('figure', {class: 'viewer'},
        h('div', {class: 'tools', role: 'toolbar', 'aria-label': 'Picture'}, kinds,
            h('label', {for: 'exposure'}, kind === 'error' ? 'Range' : 'Exposure'), this.slider, this.exposureText,
            h('span', {class: 'group'}, button('−', 'Zoom out', () => this.zoomBy(0.5)), this.zoomText, button('+', 'Zoom in', () => this.zoomBy(2)),
                button('Fit', 'Fit the picture into the view', () => this.fit()), button('1:1', '1:1, one pixel for one pixel', () => this.zoomTo(1)))),
        h('div', {class: 'stage'}, this.canvas, this.empty),
        h('figcaption', {}, this.readout, h('span', {id: 'viewer-keys', class: 'keys'}, 'Drag to move, wheel or + − to zoom, 0 to fit, [ ] for exposure, arrows for a pixel')));
    if (kind === 'error')
      this.element.insertBefore(h('div', {class: 'legend'}, h('span', {}), h('canvas', {width: 256, height: 1, 'aria-hidden': 'true'}), h('span', {})), this.element.lastChild);
    this.listen();
    this.observer = new ResizeObserver(() => this.layout());
    this.observer.observe(this.canvas.parentElement);
    this.setExposure(0);
  }

  onkind() {}

  close() {
    this.observer.disconnect();
    this.closed = true;
  }

  listen() {
    const c = this.canvas;
    const pointers = new Map();
    c.addEventListener('pointerdown', (e) => {
      c.setPointerCapture(e.pointerId);
      pointers.set(e.pointerId, [e.offsetX, e.offsetY]);
    });
    c.addEventListener('pointermove', (e) => {
      const before = pointers.get(e.pointerId);
      if (before) {
        if (pointers.size === 2) {
          const other = [...pointers].find(([id]) => id !== e.pointerId)[1];
          const d = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
          if (d(before) > 0) this.zoomBy(d([e.offsetX, e.offsetY]) / d(before));
        } else {
          this.pan(e.offsetX - before[0], e.offsetY - before[1]);
        }
        pointers.set(e.pointerId, [e.offsetX, e.offsetY]);
      }
      this.point(this.imageAt(e.offsetX, e.offsetY));
    });
    for (const kind of ['pointerup', 'pointercancel']) c.addEventListener(kind, (e) => pointers.delete(e.pointerId));
    c.addEventListener('pointerleave', () => this.point(null));
    c.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.zoomBy(2 ** (-e.deltaY / 300), e.offsetX, e.offsetY);
    }, {passive: false});
    c.addEventListener('keydown', (e) => {
      const move = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[e.key];
      if (move && this.levels.length) {
        const [w, hgt] = [this.levels[0].width, this.levels[0].height], step = e.shiftKey ? 16 : 1;
        const at = this.cursor || [Math.floor(w / 2), Math.floor(hgt / 2)];
        this.point([Math.min(w - 1, Math.max(0, at[0] + step * move[0])), Math.min(hgt - 1, Math.max(0, at[1] + step * move[1]))]);
        this.draw();
      } else if (e.key === '+' || e.key === '=') this.zoomBy(2);
      else if (e.key === '-') this.zoomBy(0.5);
      else if (e.key === '0') this.fit();
      else if (e.key === '1') this.zoomTo(1);
      else if (e.key === '[') this.setExposure(this.exposure - 0.5);
      else if (e.key === ']') this.setExposure(this.exposure + 0.5);
      else return;
      e.preventDefault();
    });
  }

  setExposure(v) {
    this.exposure = Math.min(10, Math.max(-10, Math.round(v * 10) / 10));
    this.slider.value = this.exposure;
    put(this.exposureText, (this.exposure > 0 ? '+' : '') + this.exposure.toFixed(1) + (this.kind === 'error' ? '' : ' EV'));
    for (const [key, tile] of this.tiles) this.paint(key, tile);
    const legend = this.element.querySelector('.legend');
    if (legend) {
      const high = 2 ** -this.exposure;
      put(legend.firstChild, small(100 * high / 10 ** kDecades) + ' %');
      put(legend.lastChild, small(100 * high) + ' % relative error');
      const context = legend.children[1].getContext('2d'), image = context.createImageData(256, 1);
      for (let i = 0; i < 256; ++i) for (let k = 0; k < 4; ++k) image.data[4 * i + k] = k < 3 ? kColors[3 * i + k] : 255;
      context.putImageData(image, 0, 0);
    }
    this.draw();
  }

  // A picture is there: {iterations, levels}.
  picture(p) {
    const first = !this.levels.length;
    this.levels = p.levels;
    this.iterations = p.iterations;
    ++this.serial;
    this.empty.hidden = true;
    this.canvas.setAttribute('aria-label', (this.kind === 'error' ? 'Error map' : 'Image') + ' of ' + p.levels[0].width + ' by ' + p.levels[0].height + ' pixels after ' + p.iterations + ' iterations');
    this.canvas.parentElement.style.setProperty('--ratio', p.levels[0].width / p.levels[0].height);
    if (first) this.layout();
    this.want();
    if (this.cursor) this.ask();
  }

  none(message) {
    if (!this.levels.length) put(this.empty, message.charAt(0).toUpperCase() + message.slice(1) + '.');
  }

  layout() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    const w = Math.max(1, Math.round(box.width * ratio)), hgt = Math.max(1, Math.round(box.height * ratio));
    if (this.canvas.width !== w || this.canvas.height !== hgt) {
      this.canvas.width = w;
      this.canvas.height = hgt;
    }
    this.draw();
    this.want();
  }

  // Device pixels an image pixel.
  zoom() {
    if (!this.levels.length) return 1;
    const {width, height} = this.levels[0];
    return this.scale || Math.min(this.canvas.width / width, this.canvas.height / height);
  }
  level() {
    return Math.max(0, Math.min(this.levels.length - 1, Math.floor(Math.log2(1 / this.zoom()) + 0.01)));
  }
  // Left upper corner of the image in device pixels.
  origin() {
    const z = this.zoom(), {width, height} = this.levels[0];
    return [this.canvas.width / 2 - this.center[0] * width * z, this.canvas.height / 2 - this.center[1] * height * z];
  }
  imageAt(x, y) {
    if (!this.levels.length) return null;
    const ratio = this.canvas.width / this.canvas.clientWidth, z = this.zoom(), [ox, oy] = this.origin();
    const at = [Math.floor((x * ratio - ox) / z), Math.floor((y * ratio - oy) / z)];
    return at[0] >= 0 && at[1] >= 0 && at[0] < this.levels[0].width && at[1] < this.levels[0].height ? at : null;
  }
  fit() {
    this.scale = 0;
    this.center = [0.5, 0.5];
    this.moved();
  }
  zoomTo(scale) {
    this.scale = scale;
    this.moved();
  }
  zoomBy(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    if (!this.levels.length) return;
    const ratio = this.canvas.width / this.canvas.clientWidth;
    const before = this.zoom(), after = Math.min(64, Math.max(1 / 64, before * factor));
    const {width, height} = this.levels[0];
    const [dx, dy] = [x * ratio - this.canvas.width / 2, y * ratio - this.canvas.height / 2];
    this.center = [this.center[0] + (dx / before - dx / after) / width, this.center[1] + (dy / before - dy / after) / height];
    this.scale = after;
    this.moved();
  }
  pan(dx, dy) {
    if (!this.levels.length) return;
    const ratio = this.canvas.width / this.canvas.clientWidth, z = this.zoom();
    this.scale = z;
    this.center = [this.center[0] - (dx * ratio) / z / this.levels[0].width, this.center[1] - (dy * ratio) / z / this.levels[0].height];
    this.moved();
  }
  moved() {
    this.center = this.center.map((v) => Math.min(1, Math.max(0, v)));
    this.draw();
    this.want();
  }

  // Asks for the tiles in view that are older than the picture.
  want() {
    if (!this.levels.length || this.closed) return;
    const level = this.level(), {width, height} = this.levels[level], z = this.zoom() * 2 ** level, [ox, oy] = this.origin();
    this.queue = [];
    for (let y = 0; y * kTile < height; ++y)
      for (let x = 0; x * kTile < width; ++x) {
        const left = ox + x * kTile * z, top = oy + y * kTile * z;
        if (left > this.canvas.width || top > this.canvas.height || left + kTile * z < 0 || top + kTile * z < 0) continue;
        const key = `${level}/${x}/${y}`, tile = this.tiles.get(key);
        if (!tile || tile.serial !== this.serial) this.queue.push(key);
      }
    this.pump();
  }
  pump() {
    while (this.running < kFetches && this.queue.length) {
      const key = this.queue.shift();
      ++this.running;
      this.fetch(key).catch(() => {}).finally(() => {
        --this.running;
        this.pump();
      });
    }
  }
  async fetch(key) {
    const [level, x, y] = key.split('/').map(Number), serial = this.serial, tile = this.tiles.get(key);
    const answer = await fetch(`/api/jobs/${encodeURIComponent(this.job)}/tile?kind=${this.kind}&level=${level}&x=${x}&y=${y}`,
        {cache: 'no-store', headers: tile ? {'If-None-Match': tile.etag} : {}});
    if (answer.status === 304) {
      tile.serial = serial;
      return;
    }
    if (!answer.ok || this.closed) return;
    const made = {etag: answer.headers.get('ETag'), data: new Uint8Array(await answer.arrayBuffer()), serial};
    this.tiles.set(key, made);
    this.paint(key, made);
    this.draw();
  }

  sheet(level) {
    let sheet = this.sheets.get(level);
    if (!sheet) {
      sheet = h('canvas', {width: this.levels[level].width, height: this.levels[level].height});
      this.sheets.set(level, sheet);
    }
    return sheet;
  }
  paint(key, tile) {
    const [level, x, y] = key.split('/').map(Number), {width, height} = this.levels[level];
    const w = Math.min(kTile, width - x * kTile), hgt = Math.min(kTile, height - y * kTile);
    if (tile.data.length !== 4 * w * hgt) return;
    const image = new ImageData(w, hgt), out = image.data, data = tile.data, error = this.kind === 'error', gain = 2 ** this.exposure;
    for (let i = 0; i < data.length; i += 4) {
      const scale = data[i + 3] ? 2 ** (data[i + 3] - 136) * gain : 0;
      if (error) {
        const v = data[i] * scale;
        const c = v > 0 ? 3 * Math.max(0, Math.min(255, Math.round(255 * (1 + Math.log10(v) / kDecades)))) : 0;
        out[i] = kColors[c];
        out[i + 1] = kColors[c + 1];
        out[i + 2] = kColors[c + 2];
      } else {
        for (let k = 0; k < 3; ++k) out[i + k] = kSrgb[Math.round(kSteps * Math.sqrt(Math.min(1, data[i + k] * scale)))];
      }
      out[i + 3] = 255;
    }
    this.sheet(level).getContext('2d').putImageData(image, x * kTile, y * kTile);
  }

  draw() {
    if (this.drawing) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = 0;
      this.drawNow();
    });
  }
  drawNow() {
    const context = this.canvas.getContext('2d');
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!this.levels.length) return;
    const z = this.zoom(), [ox, oy] = this.origin(), level = this.level();
    put(this.zoomText, Math.round(100 * z) + ' %');
    context.imageSmoothingEnabled = z < 1;
    // Coarser levels first, so that nothing is empty while tiles come.
    for (const l of [...this.sheets.keys()].sort((a, b) => b - a)) {
      if (l < level) continue;
      const sheet = this.sheets.get(l);
      context.drawImage(sheet, ox, oy, sheet.width * 2 ** l * z, sheet.height * 2 ** l * z);
    }
    if (this.cursor && z >= 4) {
      context.strokeStyle = '#fff';
      context.strokeRect(ox + this.cursor[0] * z - 0.5, oy + this.cursor[1] * z - 0.5, z + 1, z + 1);
    }
  }

  point(at) {
    this.cursor = at;
    if (!at) {
      put(this.readout, '');
      return;
    }
    this.ask();
  }
  // The value of the pixel as the master has it, at most ten times a second.
  ask() {
    if (this.asking) return;
    this.asking = true;
    setTimeout(async () => {
      const at = this.cursor;
      try {
        if (at && !this.closed) {
          const answer = await fetch(`/api/jobs/${encodeURIComponent(this.job)}/pixel?kind=${this.kind}&x=${at[0]}&y=${at[1]}`, {cache: 'no-store'});
          if (answer.ok) {
            const p = await answer.json();
            put(this.readout, `(${at[0]}, ${at[1]})  ` + (this.kind === 'error' ? small(100 * p.r) + ' % error' : [p.r, p.g, p.b].map(small).join('  ')));
          }
        }
      } catch { /* the stream says that the master is away */ }
      this.asking = false;
      if (this.cursor && at && (this.cursor[0] !== at[0] || this.cursor[1] !== at[1])) this.ask();
    }, 100);
  }
}
