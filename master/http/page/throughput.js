// Charts of the farm's day: samples a second, busy workers, hours in the queue.
import {count, duration, figure, h, put} from './dom.js';

const kWidth = 240, kHeight = 32, kDay = 86400e3, kMinSpan = 1800e3;
const kPoints = 240;  // a chart has at most so many: each is the mean of its part of the day

const hours = (s) => (s === null ? 'no worker' : s < 60 ? '0 min' : s < 3600 ? Math.round(s / 60) + ' min' : s < 3600 * 999.5 ? (s / 3600).toPrecision(s < 36000 ? 2 : 3) + ' h' : duration(s));
// A point is [unix_ms, samples_per_second, busy, workers, queue_seconds, endless].
const kSeries = [
  {label: 'Samples/s', value: (p) => p[1], text: (p) => count(p[1])},
  {label: 'Busy workers', value: (p) => p[2], top: (p) => p[3], text: (p) => `${p[2]} of ${p[3]}`},
  {label: 'Queue', value: (p) => (p[4] === null ? null : p[4] / 3600), text: (p) => hours(p[4]), more: (p) => (p[5] ? `and ${p[5]} without an end` : '')},
];

export class Throughput {
  constructor() {
    this.points = [];
    this.now = null;
    this.at = null;  // the moment that is pointed at, as a share of the width
    this.parts = kSeries.map((s) => ({...s, number: h('b', {}, '–'), time: h('span', {class: 'note'}), plot: h('span', {class: 'spark'})}));
    this.element = h('section', {class: 'throughput', 'aria-label': 'The farm over the day'}, ...this.parts.map((p) => h('div', {}, h('span', {class: 'figure'}, h('span', {class: 'note'}, p.label), p.number, p.time), p.plot)));
    for (const {plot} of this.parts) {
      plot.addEventListener('pointermove', (e) => { this.at = e.offsetX / plot.clientWidth; this.draw(); });
      plot.addEventListener('pointerleave', () => { this.at = null; this.draw(); });
    }
  }
  close() {}
  all({points, now}) {
    this.points = points;
    this.now = now;
    this.draw();
  }
  point(p, kept) {
    this.now = p;
    if (kept) {
      this.points.push(p);
      const first = p[0] - kDay;
      while (this.points.length && this.points[0][0] < first) this.points.shift();
    }
    this.draw();
  }
  jobs() {}
  draw() {
    if (!this.now) return;
    const points = [...this.points, this.now], end = this.now[0], begin = Math.min(points[0][0], end - kMinSpan), span = end - begin;
    let chosen = this.now;
    if (this.at !== null) {
      const t = begin + this.at * span;
      chosen = points.reduce((best, p) => (Math.abs(p[0] - t) < Math.abs(best[0] - t) ? p : best), this.now);
    }
    const shown = thinned(points, begin, span);
    const time = this.at === null ? '' : new Date(chosen[0]).toLocaleTimeString(undefined, {timeStyle: 'short'});
    const X = (t) => ((t - begin) / span) * kWidth;
    for (const {label, value, top, text, more, number, time: said, plot} of this.parts) {
      put(number, text(chosen));
      put(said, time || (more ? more(chosen) : ''));
      const most = Math.max(1e-9, ...shown.map((p) => Math.max(value(p) ?? 0, top ? top(p) : 0)));
      const Y = (v) => kHeight - 1 - (v / most) * (kHeight - 3);
      const line = (f) => shown.filter((p) => f(p) !== null).map((p) => X(p[0]).toFixed(1) + ',' + Y(f(p)).toFixed(1));
      const path = line(value);
      const children = [];
      if (top) children.push(h('polyline', {class: 'all', points: line(top).join(' ')}));
      if (path.length > 1) {
        children.push(h('path', {class: 'area', d: `M${path[0].split(',')[0]},${kHeight} L${path.join(' L')} L${path.at(-1).split(',')[0]},${kHeight} Z`}));
        children.push(h('polyline', {class: 'line', points: path.join(' ')}));
      }
      if (this.at !== null) children.push(h('line', {class: 'at', x1: X(chosen[0]), x2: X(chosen[0]), y1: 0, y2: kHeight}));
      plot.replaceChildren(h('svg', {viewBox: `0 0 ${kWidth} ${kHeight}`, preserveAspectRatio: 'none', role: 'img', 'aria-label': `${label} over ${hours(span / 1000)}: now ${text(this.now)}, at most ${top ? figure(most) : count(most)}`}, ...children));
    }
  }
}

// Means over equal parts of the time.
function thinned(points, begin, span) {
  if (points.length <= kPoints) return points;
  const parts = new Map();
  for (const p of points) {
    const k = Math.min(kPoints - 1, Math.floor(((p[0] - begin) / span) * kPoints));
    if (!parts.has(k)) parts.set(k, []);
    parts.get(k).push(p);
  }
  const mean = (all, i) => {
    const known = all.map((p) => p[i]).filter((v) => v !== null);
    return known.length ? known.reduce((a, b) => a + b, 0) / known.length : null;
  };
  return [...parts.values()].map((all) => [0, 1, 2, 3, 4, 5].map((i) => mean(all, i)));
}
