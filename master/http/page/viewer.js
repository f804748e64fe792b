// The live picture: tiles of the image, its error, a layer or a mix, shown with an exposure or as false color, to pan and zoom.
import {Colors} from './colors.js';
import {h, put, small} from './dom.js';
import {channelsOf, colorize, linear, tileOf, tone} from './tones.js';

const kTile = 256;
const kFetches = 4;  // at a time; a browser has six connections to one server

// A mix asks for all layers of a tile at once, and less often.
export const sourceQuery = ({kind, layer}) => 'kind=' + kind + (layer ? '&layer=' + encodeURIComponent(layer) : '');

export class Viewer {
  constructor(job) {
    this.job = job;
    this.source = {kind: 'image', layer: ''};
    this.exposure = 0;
    this.levels = [];
    this.letters = 'RGB';
    this.first = 0;  // the finest level that has pixels
    this.partition = [];
    this.mix = null;  // the weights of a mix: {weights()}
    this.tiles = new Map();  // 'level/x/y': {etag, tile, serial, look}
    this.sheets = new Map();  // by level: a canvas of the whole picture
    this.look = 0;  // counts what changes the colors of all pixels
    this.scale = 0;  // screen pixels an image pixel; 0: fit
    this.center = [0.5, 0.5];  // of the view, as share of the image
    this.cursor = null;
    this.region = null;  // [x0, y0, x1, y1]: both corners are in it
    this.drawsRegion = false;
    this.queue = [];
    this.running = 0;
    this.serial = 0;

    this.canvas = h('canvas', {tabindex: 0, role: 'img', 'aria-describedby': 'viewer-keys'});
    this.empty = h('p', {class: 'empty'}, 'Waiting for the first iterations.');
    this.readout = h('output', {class: 'readout', 'aria-label': 'Pixel values'}, '');
    this.exposureText = h('output', {}, '0.0');
    this.slider = h('input', {type: 'range', min: -10, max: 10, step: 0.1, value: 0, id: 'exposure', oninput: () => this.setExposure(Number(this.slider.value))});
    const button = (text, label, f, more = {}) => h('button', {type: 'button', 'aria-label': label, title: label, onclick: f, ...more}, text);
    this.zoomText = h('output', {class: 'zoom', 'aria-label': 'Zoom'}, '');
    this.kinds = h('select', {'aria-label': 'Picture', onchange: () => this.choose(this.kinds.value)});
    this.colors = new Colors({changed: () => this.recolor(), ask: () => (this.levels.length ? `/api/jobs/${encodeURIComponent(this.job)}/colors?${sourceQuery(this.source)}` : null)});
    this.drawer = button('Rectangle', 'Draw a rectangle', () => this.drawRegion(!this.drawsRegion), {'aria-pressed': 'false'});
    this.exposureLabel = h('label', {for: 'exposure'}, 'Exposure');
    this.listKinds([]);
    this.element = h('figure', {class: 'viewer'},
        h('div', {class: 'tools', role: 'toolbar', 'aria-label': 'Picture'}, this.kinds, this.colors.shown, this.exposureLabel, this.slider, this.exposureText, this.colors.tools, this.drawer,
            h('span', {class: 'group'}, button('−', 'Zoom out', () => this.zoomBy(0.5)), this.zoomText, button('+', 'Zoom in', () => this.zoomBy(2)),
                button('Fit', 'Fit the picture into the view', () => this.fit()), button('1:1', '1:1, one pixel for one pixel', () => this.zoomTo(1)))),
        h('div', {class: 'stage'}, this.canvas, this.empty), this.colors.box,
        h('figcaption', {}, this.readout, h('span', {id: 'viewer-keys', class: 'keys'}, 'Drag to move, wheel or + − to zoom, 0 to fit, [ ] for exposure, arrows for a pixel')));
    this.listen();
    this.observer = new ResizeObserver(() => this.layout());
    this.observer.observe(this.canvas.parentElement);
    this.setExposure(0);
    this.recolor();
  }

  // Another picture is wanted: {kind, layer}.
  onsource() {}
  onregion() {}
  onlayers() {}

  get kind() {
    return this.source.kind;
  }
  choose(value) {
    const [kind, layer = ''] = value.split(':');
    if (kind === this.source.kind && layer === this.source.layer) return;
    this.source = {kind, layer};
    this.kinds.value = value;
    // The pixels of the picture before stay in sight until those of this one come.
    this.tiles.clear();
    this.stale = true;
    this.levels = [];
    this.queue = [];
    ++this.serial;
    this.onsource(this.source);
  }
  listKinds(layers, partition = []) {
    const key = JSON.stringify([layers, partition.length]);
    if (key === this.listed) return;
    this.listed = key;
    const option = (value, text) => h('option', {value}, text);
    this.kinds.replaceChildren(option('image', 'Image'), option('error', 'Error map'), ...(partition.length ? [option('mix', 'Mix of lights')] : []),
        ...(layers.length ? [h('optgroup', {label: 'Layers'}, ...layers.map(({name}) => option('layer:' + name, name)))] : []));
    this.kinds.value = this.source.layer ? 'layer:' + this.source.layer : this.source.kind;
  }
  // Shows one number of the pixels, if colors are shown now.
  chooseChannel() {
    if (this.kind === 'mix') return;
    this.colors.channel = this.colors.shown.value = channelsOf(this.letters)[0];
    this.colors.update();
    this.recolor();
  }
  get form() {
    return this.colors.on || this.kind === 'layer' || this.kind === 'mix' ? 'half' : 'rgbe';
  }
  recolor() {
    const on = this.colors.on;
    this.exposureLabel.hidden = this.slider.hidden = this.exposureText.hidden = on;
    if (this.form !== this.fetched) {
      this.fetched = this.form;
      ++this.serial;
      this.want();
    }
    ++this.look;
    this.draw();
  }

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
      this.anchor = this.drawsRegion && pointers.size === 1 ? this.nearest(e.offsetX, e.offsetY) : null;
    });
    c.addEventListener('pointermove', (e) => {
      const before = pointers.get(e.pointerId);
      if (before) {
        if (this.anchor) {
          this.dragRegion(this.anchor, this.nearest(e.offsetX, e.offsetY));
        } else if (pointers.size === 2) {
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
    for (const kind of ['pointerup', 'pointercancel'])
      c.addEventListener(kind, (e) => {
        pointers.delete(e.pointerId);
        if (!this.anchor) return;
        this.anchor = null;
        this.drawRegion(false);
        if (this.region) this.onregion();
      });
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
    put(this.exposureText, (this.exposure > 0 ? '+' : '') + this.exposure.toFixed(1) + ' EV');
    ++this.look;
    this.draw();
  }

  // A picture is there: {iterations, levels, first, letters, layers, partition}.
  picture(p) {
    const first = !this.levels.length;
    if (this.stale) {
      this.stale = false;
      for (const sheet of this.sheets.values()) sheet.old = true;
    }
    this.levels = p.levels;
    this.iterations = p.iterations;
    this.letters = p.letters;
    this.first = p.first;
    this.partition = p.partition;
    ++this.serial;
    this.listKinds(p.layers, p.partition);
    this.onlayers(p.partition);
    this.colors.begin(this.kind, p.letters);
    this.recolor();
    this.colors.update();
    this.empty.hidden = true;
    const what = {image: 'Image', error: 'Error map', layer: 'Layer ' + this.source.layer, mix: 'Mix of lights'}[this.kind];
    this.canvas.setAttribute('aria-label', what + ' of ' + p.levels[0].width + ' by ' + p.levels[0].height + ' pixels after ' + p.iterations + ' iterations');
    this.canvas.parentElement.style.setProperty('--ratio', p.levels[0].width / p.levels[0].height);
    if (first) this.layout();
    this.want();
    if (this.cursor) this.ask();
    if (this.region) this.onregion();
  }

  none(message) {
    if (this.levels.length) return;
    this.empty.hidden = false;
    put(this.empty, message.charAt(0).toUpperCase() + message.slice(1) + '.');
    this.draw();
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
    return Math.max(this.first, Math.min(this.levels.length - 1, Math.floor(Math.log2(1 / this.zoom()) + 0.01)));
  }
  // Left upper corner of the image in device pixels.
  origin() {
    const z = this.zoom(), {width, height} = this.levels[0];
    return [this.canvas.width / 2 - this.center[0] * width * z, this.canvas.height / 2 - this.center[1] * height * z].map(Math.round);
  }
  imageAt(x, y) {
    if (!this.levels.length) return null;
    const ratio = this.canvas.width / this.canvas.clientWidth, z = this.zoom(), [ox, oy] = this.origin();
    const at = [Math.floor((x * ratio - ox) / z), Math.floor((y * ratio - oy) / z)];
    return at[0] >= 0 && at[1] >= 0 && at[0] < this.levels[0].width && at[1] < this.levels[0].height ? at : null;
  }
  // The pixel of the image next to a place of the view.
  nearest(x, y) {
    if (!this.levels.length) return null;
    const ratio = this.canvas.width / this.canvas.clientWidth, z = this.zoom(), [ox, oy] = this.origin();
    return [[x * ratio - ox, this.levels[0].width], [y * ratio - oy, this.levels[0].height]].map(([v, size]) => Math.min(size - 1, Math.max(0, Math.floor(v / z))));
  }
  drawRegion(on) {
    this.drawsRegion = on;
    this.drawer.setAttribute('aria-pressed', String(on));
    if (on && !this.region && this.levels.length) {  // for who has no pointer: a rectangle whose corners are fields
      const {width, height} = this.levels[0];
      this.setRegion([width * 0.4, height * 0.4, width * 0.6, height * 0.6].map(Math.floor));
    }
  }
  dragRegion([x, y], [u, v]) {
    this.region = [Math.min(x, u), Math.min(y, v), Math.max(x, u), Math.max(y, v)];
    this.draw();
  }
  setRegion(at) {
    const {width, height} = this.levels[0] ?? {width: 1, height: 1};
    this.region = at && at.map((v, i) => Math.min((i % 2 ? height : width) - 1, Math.max(0, v)));
    this.draw();
    this.onregion();
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
    const [level, x, y] = key.split('/').map(Number), {serial, source, form} = this, known = this.tiles.get(key);
    const answer = await fetch(`/api/jobs/${encodeURIComponent(this.job)}/tile?${sourceQuery(this.source)}&form=${form}&level=${level}&x=${x}&y=${y}`,
        {cache: 'no-store', headers: known && known.tile.form === form ? {'If-None-Match': known.etag} : {}});
    if (source !== this.source) return;
    if (answer.status === 304) {
      known.serial = serial;
      return;
    }
    if (!answer.ok || this.closed) return;
    const buffer = await answer.arrayBuffer();
    if (source !== this.source || !this.levels.length) return;
    const [w, hgt] = this.size(level, x, y);
    const tile = tileOf(buffer, form, w * hgt, this.kind === 'mix' ? this.partition.length : 1);
    if (!tile) return;
    this.tiles.set(key, {etag: answer.headers.get('ETag'), tile, serial, look: -1});
    this.draw();
  }

  // Size of a tile, in pixels.
  size(level, x, y) {
    const {width, height} = this.levels[level];
    return [Math.min(kTile, width - x * kTile), Math.min(kTile, height - y * kTile)];
  }
  sheet(level) {
    const {width, height} = this.levels[level];
    let sheet = this.sheets.get(level);
    if (!sheet || sheet.width !== width || sheet.height !== height) {
      sheet = h('canvas', {width, height});
      this.sheets.set(level, sheet);
    }
    return sheet;
  }
  // Paints the tiles of a level that are not painted as they are to look now.
  paint(level) {
    if (this.colors.on && !this.colors.now) return;
    for (const [key, made] of this.tiles) {
      const [l, x, y] = key.split('/').map(Number);
      if (l !== level || made.look === this.look) continue;
      made.look = this.look;
      const [w, hgt] = this.size(level, x, y), image = new ImageData(w, hgt);
      const values = linear(made.tile, this.kind === 'mix' ? this.mix.weights() : null);
      if (this.colors.on) colorize(values, this.colors.number(), this.colors.now, image.data);
      else tone(values, 2 ** this.exposure, image.data);
      const sheet = this.sheet(level);
      sheet.old = false;
      sheet.getContext('2d').putImageData(image, x * kTile, y * kTile);
    }
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
    // Coarser levels first, so that nothing is empty while tiles come; sheets of the picture before lie below all.
    for (let l = this.levels.length - 1; l >= level; --l) this.paint(l);
    const sheets = [...this.sheets].filter(([l]) => l >= level && l < this.levels.length).sort(([a, s], [b, t]) => !!t.old - !!s.old || b - a);
    for (const [l, sheet] of sheets) context.drawImage(sheet, ox, oy, sheet.width * 2 ** l * z, sheet.height * 2 ** l * z);
    if (this.region) {
      const [x0, y0, x1, y1] = this.region, box = [ox + x0 * z - 1, oy + y0 * z - 1, (x1 - x0 + 1) * z + 2, (y1 - y0 + 1) * z + 2];
      for (const [color, width] of [['#000', 3], ['#fff', 1]]) {
        context.strokeStyle = color;
        context.lineWidth = width;
        context.strokeRect(...box);
      }
      context.lineWidth = 1;
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
  tell([x, y], [r, g, b]) {
    const values = this.letters.length === 1 ? [r] : [r, g, b].slice(0, this.letters.length);
    put(this.readout, `(${x}, ${y})  ` + (this.kind === 'error' ? small(100 * r) + ' % error' : values.map((v) => small(v)).join('  ')));
  }
  // A mix is known here alone: at the level that is shown.
  tellMix(at) {
    const level = this.level(), [x, y] = at.map((v) => v >> level), made = this.tiles.get(`${level}/${Math.floor(x / kTile)}/${Math.floor(y / kTile)}`);
    if (!made) return;
    const [w] = this.size(level, Math.floor(x / kTile), Math.floor(y / kTile));
    this.tell(at, linear(made.tile, this.mix.weights(), (y % kTile) * w + (x % kTile), 1));
  }
  // The value of the pixel as the master has it, at most ten times a second.
  ask() {
    if (this.asking) return;
    this.asking = true;
    setTimeout(async () => {
      const at = this.cursor;
      try {
        if (at && !this.closed && this.kind === 'mix') {
          this.tellMix(at);
        } else if (at && !this.closed) {
          const answer = await fetch(`/api/jobs/${encodeURIComponent(this.job)}/pixel?${sourceQuery(this.source)}&x=${at[0]}&y=${at[1]}`, {cache: 'no-store'});
          if (answer.ok) {
            const p = await answer.json();
            this.tell(at, [p.r, p.g, p.b]);
          }
        }
      } catch { /* the stream says that the master is away */ }
      this.asking = false;
      if (this.cursor && at && (this.cursor[0] !== at[0] || this.cursor[1] !== at[1])) this.ask();
    }, 100);
  }
}
