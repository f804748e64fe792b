// A mix of the layers that add up to the image: sliders for intensity and tint, shown at once, and its file, which
// `candela fetch --mix` applies.
import {h, put} from './dom.js';
import {commandLine} from './region.js';
import {toLinear, toSrgb} from './tones.js';

const kMax = 8;  // times: the right end of a slider; a field takes more
const kMaxFactor = 1e6;
const round = (v) => Number(v.toPrecision(6));
// The middle of the slider is 1.
const intensityAt = (p) => round(kMax * (p / 100) ** 3);
const placeOf = (v) => 100 * Math.cbrt(Math.min(kMax, v) / kMax);
const hexOf = (tint) => '#' + tint.map((v) => Math.round(255 * toSrgb(Math.min(1, v))).toString(16).padStart(2, '0')).join('');
const tintOf = (hex) => [1, 3, 5].map((i) => round(toLinear(parseInt(hex.slice(i, i + 2), 16) / 255)));
const white = () => [1, 1, 1];

// Reads a mix file: the weights of each layer. Throws an Error that names the key.
export function parseMix(text, names) {
  const fail = (key, message) => { throw new Error(`${key}: ${message}`); };
  const isObject = (v) => v !== null && typeof v === 'object' && !Array.isArray(v);
  let json;
  try {
    json = JSON.parse(text);
  } catch {
    throw new Error('This file is no JSON.');
  }
  if (!isObject(json)) throw new Error('The mix is no object.');
  for (const key of Object.keys(json)) if (key !== 'layers') fail(key, 'this key is not known');
  if (!isObject(json.layers)) fail('layers', 'it is no object');
  const factor = (v, key) => (typeof v === 'number' && v >= 0 && v <= kMaxFactor ? v : fail(key, `it is no number from 0 to ${kMaxFactor}`));
  return new Map(Object.entries(json.layers).map(([name, layer]) => {
    const key = 'layers.' + name;
    if (!names.includes(name)) fail(key, 'this job has no such layer to mix');
    if (!isObject(layer)) fail(key, 'it is no object');
    for (const word of Object.keys(layer)) if (word !== 'intensity' && word !== 'tint') fail(`${key}.${word}`, 'this key is not known');
    const {intensity = 1, tint = white()} = layer;
    if (!Array.isArray(tint) || tint.length !== 3) fail(key + '.tint', 'it is no list of 3 numbers');
    return [name, {intensity: factor(intensity, key + '.intensity'), tint: tint.map((v, i) => factor(v, `${key}.tint[${i}]`))}];
  }));
}

export class Mix {
  // `changed()`: the weights are others.
  constructor(job, changed) {
    Object.assign(this, {job, changed, names: [], layers: new Map()});
    this.rows = h('div', {class: 'lights'});
    this.trouble = h('p', {class: 'trouble', role: 'alert'});
    const file = h('input', {type: 'file', accept: '.json,application/json', class: 'hidden', id: 'mix-file', tabindex: -1, 'aria-label': 'A mix that was saved', onchange: async () => {
      if (file.files.length) this.load(await file.files[0].text());
      file.value = '';
    }});
    this.command = commandLine('the command that writes this mix as an EXR');
    this.element = h('section', {'aria-label': 'Mix of lights', class: 'mix', hidden: true}, h('h2', {}, 'Mix of lights'), this.rows,
        h('div', {class: 'buttons'}, h('button', {type: 'button', onclick: () => this.reset()}, 'Reset'),
            h('button', {type: 'button', onclick: () => this.save()}, 'Save mix.json'),
            h('button', {type: 'button', onclick: () => file.click()}, 'Load…'), file), this.trouble,
        h('p', {class: 'note'}, 'The estimated error is that of the image, not of the mix. With the file that was saved, in full precision and size:'), this.command.element);
    this.command.show(`candela fetch ${job} -o mix.exr --mix mix.json`);
  }
  // The layers that add up to the image, in the order of the tiles.
  setNames(names) {
    this.element.hidden = names.length === 0;
    if (names.join() === this.names.join()) return;
    this.names = names;
    this.rows.replaceChildren(...names.map((name) => this.row(name)));
  }
  row(name) {
    const layer = {on: true, intensity: 1, tint: white()};
    this.layers.set(name, layer);
    const change = () => {
      layer.show();
      put(this.trouble, '');
      this.changed();
    };
    const on = h('input', {type: 'checkbox', 'aria-label': name + ' is on', onchange: () => { layer.on = on.checked; change(); }});
    const slider = h('input', {type: 'range', min: 0, max: 100, step: 'any', 'aria-label': 'Intensity of ' + name, oninput: () => { layer.intensity = intensityAt(Number(slider.value)); layer.on = true; change(); }});
    // Steps of a key are of the slider's own length.
    slider.addEventListener('keydown', (e) => {
      const step = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10}[e.key];
      if (!step) return;
      e.preventDefault();
      layer.intensity = intensityAt(Math.min(100, Math.max(0, Number(slider.value) + step)));
      layer.on = true;
      change();
    });
    const number = h('input', {type: 'number', min: 0, step: 'any', inputmode: 'decimal', 'aria-label': 'Intensity of ' + name + ' as a number', onchange: () => {
      const v = Number(number.value);
      if (number.value.trim() !== '' && v >= 0 && v <= kMaxFactor) Object.assign(layer, {intensity: v, on: true});
      change();
    }});
    const tint = h('input', {type: 'color', 'aria-label': 'Tint of ' + name, oninput: () => { layer.tint = tintOf(tint.value); layer.on = true; change(); }});
    layer.show = () => {
      on.checked = layer.on;
      slider.value = placeOf(layer.intensity);
      slider.setAttribute('aria-valuetext', layer.intensity + ' times');
      if (Number(number.value) !== layer.intensity || number.value === '') number.value = layer.intensity;
      if (tint.value !== hexOf(layer.tint)) tint.value = hexOf(layer.tint);
    };
    layer.show();
    return h('div', {class: 'light', 'data-layer': name}, h('label', {class: 'lightname'}, on, ' ', name.replace(/^light\./, '')), slider, number, tint);
  }
  factors({on, intensity, tint}) {
    return tint.map((t) => (on ? intensity * t : 0));
  }
  // [red, green, blue] of each layer, in the order of the tiles.
  weights() {
    return this.names.map((name) => this.factors(this.layers.get(name)));
  }
  text() {
    const layers = {};
    for (const name of this.names) {
      const {on, intensity, tint} = this.layers.get(name);
      if (on && intensity === 1 && tint.every((t) => t === 1)) continue;
      layers[name] = {intensity: on ? intensity : 0, ...(tint.some((t) => t !== 1) ? {tint} : {})};
    }
    return JSON.stringify({layers}, null, 2) + '\n';
  }
  save() {
    const url = URL.createObjectURL(new Blob([this.text()], {type: 'application/json'}));
    h('a', {href: url, download: 'mix.json'}).click();
    setTimeout(() => URL.revokeObjectURL(url), 60000);
  }
  load(text) {
    try {
      const read = parseMix(text, this.names);
      for (const [name, layer] of this.layers) Object.assign(layer, {on: true, intensity: 1, tint: white()}, read.get(name));
      for (const layer of this.layers.values()) layer.show();
      put(this.trouble, '');
      this.changed();
    } catch (e) {
      put(this.trouble, e.message);
    }
  }
  reset() {
    this.load('{"layers": {}}');
  }
}
