// False color: which number of a pixel is shown, through which map, over which range, and the scale below the picture.
import {h, put, small} from './dom.js';
import {get} from './net.js';
import {channelsOf, colorsOf, numberOf, placeOf} from './tones.js';

const kMaps = ['viridis', 'turbo', 'grey', 'heat'];
const kPercentiles = [['1,99', '1 to 99 %'], ['0.1,99.9', '0.1 to 99.9 %'], ['5,95', '5 to 95 %'], ['0,100', 'all values']];
const kNames = {R: 'Red', G: 'Green', B: 'Blue', luminance: 'Luminance', length: 'Length'};
const kRoom = 0.14;  // of the scale, between labels

function options(list, chosen) {
  return list.map(([value, text]) => h('option', {value, selected: value === chosen}, text));
}

// Round numbers between both ends, which have room for their labels.
function ticks({low, high, logarithmic}) {
  const wanted = [];
  if (logarithmic && high / low > 30) {
    for (let e = Math.ceil(Math.log10(low)); e <= Math.log10(high); ++e) wanted.push(10 ** e);
  } else {
    const rough = (high - low) / 4, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
    for (let i = Math.ceil(low / step); i * step <= high; ++i) wanted.push(i * step);
  }
  const kept = [];
  for (const v of wanted) {
    const at = placeOf(v, {low, high, logarithmic});
    if (at > kRoom && at < 1 - kRoom && (!kept.length || at - kept.at(-1).at > kRoom)) kept.push({at, v});
  }
  return kept;
}

export class Colors {
  // `changed()`: the colors are others; `ask()`: the query of the picture, null while there is none.
  constructor({changed, ask}) {
    Object.assign(this, {changed, ask, letters: '', channel: '', map: 'viridis', logarithmic: false, percentiles: '1,99', pixels: null, now: null, serial: 0});
    const select = (label, list, key, read) => h('select', {'aria-label': label, onchange: (e) => {
      this[key] = read(e.target.value);
      this.update();
    }}, ...options(list, String(this[key])));
    this.shown = h('select', {'aria-label': 'Colors', onchange: () => {
      this.channel = this.shown.value;
      this.update();
      this.changed();
    }});
    this.maps = select('Color map', kMaps.map((m) => [m, m]), 'map', (v) => v);
    this.scale = select('Scale', [['false', 'linear'], ['true', 'log']], 'logarithmic', (v) => v === 'true');
    this.range = select('Range', kPercentiles, 'percentiles', (v) => v);
    this.tools = h('span', {class: 'colortools'}, this.maps, this.scale, this.range);
    this.bar = h('canvas', {width: 256, height: 1});
    this.ticks = h('div', {class: 'ticks', 'aria-hidden': 'true'});
    this.facts = h('p', {class: 'note'});
    this.legend = h('div', {class: 'legend', role: 'img', 'aria-label': 'Color scale'}, this.bar, this.ticks);
    this.box = h('div', {class: 'scale'}, this.legend, this.facts);
    this.begin('image', 'RGB');
  }
  get on() {
    return this.channel !== '';
  }
  // A picture of another kind, with these channels.
  begin(kind, letters) {
    if (kind === this.kind && letters === this.letters) return;
    const seen = kind === 'mix' || letters === 'RGB', list = kind === 'mix' ? [] : channelsOf(letters);
    // Mirrors and lamps have hardly any error: a wider range would be theirs.
    if (kind === 'error' && this.kind !== 'error') Object.assign(this, {map: 'heat', logarithmic: true, percentiles: '5,95'});
    else if (kind !== 'error' && this.kind === 'error') Object.assign(this, {map: 'viridis', logarithmic: false, percentiles: '1,99'});
    Object.assign(this, {kind, letters, now: null});
    if (!list.includes(this.channel)) this.channel = seen ? '' : list[0];
    this.shown.replaceChildren(...options([...(seen ? [['', 'As seen']] : []), ...list.map((c) => [c, kind === 'error' ? 'Error' : kNames[c] ?? (list.length > 1 ? c : 'Value')])], this.channel));
    this.shown.hidden = this.shown.length < 2;
    this.maps.value = this.map;
    this.scale.value = String(this.logarithmic);
    this.range.value = this.percentiles;
    this.layout();
  }
  layout() {
    this.tools.hidden = this.box.hidden = !this.on;
  }
  number() {
    return numberOf(this.channel, this.letters);
  }
  // The range of a rectangle, or of the whole picture (null).
  within(pixels) {
    this.pixels = pixels;
    this.update();
  }
  query(channel, pixels) {
    return `channel=${channel}&percentiles=${this.percentiles}&log=${this.logarithmic ? 1 : 0}&map=${this.map}` + (pixels ? '&pixels=' + pixels.join() : '');
  }
  // The numbers of a rectangle, whatever is shown.
  about(pixels) {
    const path = this.ask();
    return path && this.kind !== 'mix' ? get(`${path}&log=0&percentiles=0,100&channel=${this.channel || channelsOf(this.letters)[0]}&pixels=${pixels.join()}`) : Promise.resolve(null);
  }
  // Asks for the range and the colors, once at a time; the last wish counts.
  async update() {
    this.layout();
    const path = this.ask();
    if (!this.on || !path) return;
    const mine = ++this.serial, logarithmic = this.logarithmic;
    try {
      const answer = await get(`${path}&${this.query(this.channel, this.pixels)}`);
      if (mine !== this.serial) return;
      const empty = answer.low === null;  // no number has a place on the scale
      this.now = colorsOf(empty ? {...answer, low: 1, high: 2} : answer, logarithmic);
      this.legend.hidden = empty;
      if (empty) put(this.facts, `no ${this.name()} of ${this.pixels ? 'the rectangle' : 'the picture'} is above 0`);
      else this.draw();
      this.changed();
    } catch (e) {
      if (mine === this.serial && e.code) put(this.facts, e.message);  // else the stream says that the master is away
    }
  }
  name() {
    const name = this.kind === 'error' ? 'relative error' : kNames[this.channel] ?? (this.letters.length > 1 ? this.channel : 'value');
    return name.charAt(0).toLowerCase() + name.slice(1);
  }
  draw() {
    const c = this.now, context = this.bar.getContext('2d'), image = context.createImageData(256, 1);
    for (let i = 0; i < 256; ++i) for (let k = 0; k < 4; ++k) image.data[4 * i + k] = k < 3 ? c.map[3 * i + k] : 255;
    context.putImageData(image, 0, 0);
    const text = this.kind === 'error' ? (v) => small(Number((100 * v).toPrecision(3))) + ' %' : (v) => small(Number(v.toPrecision(3)));
    const marks = [{at: 0, v: c.low}, ...ticks(c), {at: 1, v: c.high}];
    this.ticks.replaceChildren(...marks.map(({at, v}) => {
      const mark = h('span', {}, text(v));
      mark.style.left = 100 * at + '%';
      mark.style.transform = `translateX(-${100 * at}%)`;
      return mark;
    }));
    this.legend.setAttribute('aria-label', `Color scale of the ${this.name()}, ${this.map}, ${c.logarithmic ? 'logarithmic' : 'linear'}, from ${text(c.low)} to ${text(c.high)}`);
    put(this.facts, `${this.name()} of ${this.pixels ? 'the rectangle' : 'the picture'}: ${text(c.minimum)} to ${text(c.maximum)}, mean ${text(c.mean)}` +
        (c.logarithmic && c.zero_or_less ? `; ${c.zero_or_less} pixels of 0 or less have their own color` : ''));
  }
}
