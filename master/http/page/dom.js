// Elements and texts. Names of jobs and workers are foreign text: they become text nodes, never markup.

// h('p', {class: 'note'}, 'text', child): attributes, `on...` listeners, children.
export function h(tag, attributes = {}, ...children) {
  const svg = ['svg', 'path', 'line', 'circle', 'text', 'g', 'polyline', 'rect', 'title'].includes(tag);
  const element = svg ? document.createElementNS('http://www.w3.org/2000/svg', tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.filter((c) => c !== null && c !== undefined));
  return element;
}

// Sets a text only if it differs, so that selections and screen readers are left in peace.
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Puts a sentence into the element; no number breaks at its minus sign.
export function prose(element, text) {
  if (element.textContent === text) return;
  element.replaceChildren(...text.split(/(\S*\de-\d+)/).map((part, i) => (i % 2 ? h('span', {class: 'whole'}, part) : part)));
}

export function count(n) {
  if (n === null || n === undefined) return '–';
  if (n < 1e4) return String(Math.round(n));
  for (const [size, unit] of [[1e12, 'T'], [1e9, 'G'], [1e6, 'M'], [1e3, 'k']])
    if (n >= size) return (n / size).toPrecision(3) + ' ' + unit;
  return String(n);
}

export function bytes(n) {
  if (!n) return '–';
  for (const [size, unit] of [[2 ** 40, 'TiB'], [2 ** 30, 'GiB'], [2 ** 20, 'MiB'], [2 ** 10, 'KiB']])
    if (n >= size) return (n / size).toPrecision(3) + ' ' + unit;
  return n + ' B';
}

export function duration(s) {
  if (s === null || s === undefined) return '–';
  if (s < 60) return Math.round(s) + ' s';
  if (s < 3600) return Math.floor(s / 60) + ' min ' + Math.floor(s % 60) + ' s';
  if (s < 86400) return Math.floor(s / 3600) + ' h ' + Math.floor((s % 3600) / 60) + ' min';
  if (s < 1000 * 86400) return Math.floor(s / 86400) + ' d ' + Math.floor((s % 86400) / 3600) + ' h';
  const years = s / (365.25 * 86400);  // of a limit that will not be met
  return years < 1000 ? years.toPrecision(3) + ' years' : '> 999 years';
}

export function small(v) {
  if (v === null || v === undefined) return '–';
  if (v === 0) return '0';
  return Math.abs(v) >= 0.01 && Math.abs(v) < 1e4 ? String(Number(v.toPrecision(4))) : String(Number(v.toPrecision(3)).toExponential()).replace('e+', 'e');
}

// An error, always as 3.22e-3.
export function figure(v) {
  return v === null || v === undefined ? '–' : v.toExponential(2).replace('e+', 'e');
}

// A time left: 0:45, 12:05, 1:05:00, 3 d 4 h.
export function clock(s) {
  if (s === null || s === undefined) return '–';
  const two = (n) => String(Math.floor(n)).padStart(2, '0'), whole = Math.round(s);
  if (whole >= 86400) return Math.floor(whole / 86400) + '\u00a0d\u00a0' + Math.floor((whole % 86400) / 3600) + '\u00a0h';
  const rest = two((whole % 3600) / 60) + ':' + two(whole % 60);
  return whole >= 3600 ? Math.floor(whole / 3600) + ':' + rest : rest.replace(/^0/, '');
}

const kMonths = ['Jan', 'Feb', 'Mar', 'Apr', 'May', 'Jun', 'Jul', 'Aug', 'Sep', 'Oct', 'Nov', 'Dec'];
// The time of today, the day and the time, or the day of another year.
export function shortWhen(ms) {
  if (!ms) return '–';
  const t = new Date(ms), two = (n) => String(n).padStart(2, '0'), time = two(t.getHours()) + ':' + two(t.getMinutes());
  const now = new Date(), day = t.getDate() + '\u00a0' + kMonths[t.getMonth()] + '\u00a0';
  return t.toDateString() === now.toDateString() ? time : day + (t.getFullYear() === now.getFullYear() ? time : t.getFullYear());
}

export function when(ms) {
  return ms ? new Date(ms).toLocaleString(undefined, {dateStyle: 'short', timeStyle: 'medium'}) : '–';
}

// Share of the work that is done, of the limit that will end it first; null without a limit.
export function progress(job) {
  const shares = [];
  const {time_seconds, relmse} = job.stop;
  if (job.iterations_asked) shares.push(job.iterations / job.iterations_asked);
  if (time_seconds) shares.push(job.elapsed_seconds / time_seconds);
  if (relmse && job.error_upper) shares.push(relmse / job.error_upper);
  return shares.length ? Math.min(1, Math.max(...shares)) : null;
}

export function bar(label) {
  const element = h('progress', {max: 1, value: 0, 'aria-label': label});
  return element;
}
