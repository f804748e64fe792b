// The estimated error on log axes, as SVG: measured points, the expected slope, the limit and where it is met.
import {duration, h, small, count} from './dom.js';

const kWidth = 460, kHeight = 270, kLeft = 52, kRight = 14, kTop = 14, kBottom = 40;

// Slope and level of log10 y over log10 x by least squares; null for fewer than 3 points.
export function fit(points) {
  if (points.length < 3) return null;
  let sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const [x, y] of points) {
    const u = Math.log10(x), v = Math.log10(y);
    sx += u, sy += v, sxx += u * u, sxy += u * v;
  }
  const n = points.length, below = n * sxx - sx * sx;
  return below > 1e-9 ? (n * sxy - sx * sy) / below : null;
}

// job: as from the master. axis: 'iterations' or 'seconds'. Returns the SVG element and a sentence.
export function chart(job, convergence, axis) {
  const column = axis === 'seconds' ? 1 : 0;
  const points = convergence.map((p) => [p[column], p[2]]).filter(([x, y]) => x > 0 && y > 0);
  if (points.length < 2) return {svg: null, text: 'The error is estimated when both halves have iterations.'};
  const last = points[points.length - 1];
  // The upper end of the interval, by which the limit is met; records of older masters have none.
  const uppers = convergence.map((p) => [p[column], p[3]]).filter(([x, y]) => x > 0 && y > 0);
  const upper = uppers.length && uppers[uppers.length - 1][0] === last[0] ? uppers[uppers.length - 1][1] : last[1];
  const recent = points.filter(([x]) => x >= last[0] / 10);
  const slope = fit(recent);
  const limit = job.stop.relmse || 0;
  const end = axis === 'seconds' ? job.stop.time_seconds : job.iterations_asked;
  // Variance goes as 1/n: where that line meets the limit.
  const meets = limit > 0 && upper > limit ? (last[0] * upper) / limit : 0;
  let x0 = points[0][0], x1 = Math.max(last[0], Math.min(meets || 0, last[0] * 1e3), Math.min(end || 0, last[0] * 1e3));
  let ys = points.concat(uppers).map((p) => p[1]).concat(limit > 0 ? [limit] : []);
  if (end > last[0] && end <= last[0] * 1e3) ys.push((last[0] * last[1]) / end);
  let y0 = Math.min(...ys), y1 = Math.max(...ys);
  if (x1 < x0 * 2) x1 = x0 * 2;
  y0 /= 1.3, y1 *= 1.3;
  if (y1 < y0 * 4) { const m = Math.sqrt(y0 * y1); y0 = m / 2; y1 = m * 2; }
  const X = (x) => kLeft + (Math.log(x / x0) / Math.log(x1 / x0)) * (kWidth - kLeft - kRight);
  const Y = (y) => kTop + (Math.log(y1 / y) / Math.log(y1 / y0)) * (kHeight - kTop - kBottom);
  const parts = [];
  const ticks = (from, to, most) => {
    const out = [];
    for (let e = Math.floor(Math.log10(from)); e <= Math.ceil(Math.log10(to)); ++e) out.push(10 ** e);
    let inside = out.filter((v) => v >= from && v <= to);
    if (inside.length < 2) {
      inside = out.flatMap((v) => [v, 2 * v, 5 * v]).filter((v) => v >= from && v <= to);
    }
    const step = Math.ceil(inside.length / most);
    return inside.filter((_, i) => i % step === 0);
  };
  for (const v of ticks(y0, y1, 6)) {
    parts.push(h('line', {class: 'grid', x1: kLeft, x2: kWidth - kRight, y1: Y(v), y2: Y(v)}));
    parts.push(h('text', {class: 'tick', x: kLeft - 6, y: Y(v) + 4, 'text-anchor': 'end'}, v.toExponential(0)));
  }
  for (const v of ticks(x0, x1, 6)) {
    parts.push(h('line', {class: 'grid', y1: kTop, y2: kHeight - kBottom, x1: X(v), x2: X(v)}));
    parts.push(h('text', {class: 'tick', x: X(v), y: kHeight - kBottom + 16, 'text-anchor': 'middle'},
        axis === 'seconds' ? duration(v) : count(v)));
  }
  parts.push(h('text', {class: 'label', x: (kLeft + kWidth - kRight) / 2, y: kHeight - 6, 'text-anchor': 'middle'},
      axis === 'seconds' ? 'time rendering' : 'iterations'));
  if (limit > 0) {
    parts.push(h('line', {class: 'limit', x1: kLeft, x2: kWidth - kRight, y1: Y(limit), y2: Y(limit)}));
    parts.push(h('text', {class: 'limit-label', x: kWidth - kRight - 4, y: Y(limit) - 5, 'text-anchor': 'end'},
        'stop at ' + small(limit)));
  }
  if (end && end >= x0 && end <= x1) parts.push(h('line', {class: 'limit', x1: X(end), x2: X(end), y1: kTop, y2: kHeight - kBottom}));
  // The expected slope of -1 through the last point, as far as the axes go.
  const clip = (x) => Math.min(Math.max(x, x0), x1);
  const line = (y) => (last[0] * last[1]) / y;
  const a = Math.max(clip(line(y1)), x0), b = clip(line(y0));
  parts.push(h('line', {class: 'expected', x1: X(a), y1: Y((last[0] * last[1]) / a), x2: X(b), y2: Y((last[0] * last[1]) / b)}));
  parts.push(h('polyline', {class: 'upper', points: uppers.map(([x, y]) => X(x).toFixed(1) + ',' + Y(y).toFixed(1)).join(' ')}));
  parts.push(h('polyline', {class: 'measured', points: points.map(([x, y]) => X(x).toFixed(1) + ',' + Y(y).toFixed(1)).join(' ')}));
  for (const [x, y] of points.slice(-60)) parts.push(h('circle', {class: 'point', cx: X(x).toFixed(1), cy: Y(y).toFixed(1), r: 2.2}));
  parts.push(h('circle', {class: 'now', cx: X(last[0]), cy: Y(last[1]), r: 4.5}));
  const text = 'Estimated relMSE ' + small(last[1]) + (upper > last[1] ? ', at most ' + small(upper) : '') + ' after ' +
      (axis === 'seconds' ? duration(last[0]) : count(last[0]) + ' iterations') +
      (slope === null ? '' : '; slope ' + slope.toFixed(2).replace('-', '−') + ' over the last decade, −1 expected') +
      (limit > 0 ? (meets ? '; the limit of ' + small(limit) + ' is expected at ' +
        (axis === 'seconds' ? duration(meets) : count(meets) + ' iterations') : '; the limit of ' + small(limit) + ' is met') : '') + '.';
  return {svg: h('svg', {viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img', 'aria-label': text}, ...parts), text};
}
