// The list of jobs: its order, its filters, and both as the query of an address. Nothing here needs a document, so that tests
// run it alone.
import {progress} from './dom.js';

// In the order of the list.
export const kStates = ['failed', 'running', 'queued', 'paused', 'done', 'cancelled'];
const kRank = Object.fromEntries(kStates.map((s, i) => [s, i]));
const kMaxFailed = 5;  // of the list as a whole: those that failed long ago must not hide what runs

export const share = (j) => (j.frames ? j.fraction : j.state === 'done' ? 1 : progress(j));
const ended = (j) => kRank[j.state] >= 4 || j.state === 'failed';
const order = (a, b) => (a < b ? -1 : a > b ? 1 : 0);

// Failed jobs first; then those that run; then queued ones as they will get their first leases (by priority, turn, age); then
// paused, done and cancelled ones. Those of an ended kind: the newest first. The master has the same order (wall_order).
export function compareWall(a, b) {
  if (a.state !== b.state) return (kRank[a.state] ?? 9) - (kRank[b.state] ?? 9);
  let d = 0;
  if (a.state === 'running') {
    d = b.priority - a.priority || order(a.submitted_unix_ms, b.submitted_unix_ms);
  } else if (a.state === 'queued') {
    const waits = (j) => (j.turn === null || j.turn === undefined ? 1 : 0);
    d = waits(a) - waits(b) || b.priority - a.priority || order(a.turn ?? 0, b.turn ?? 0) || order(a.submitted_unix_ms, b.submitted_unix_ms);
  } else {
    const time = (j) => (ended(j) ? j.finished_unix_ms : j.submitted_unix_ms) ?? 0;
    d = order(time(b), time(a));
  }
  return d || order(a.id, b.id);
}

// The queued jobs that get leases, the next one first.
export const queue = (jobs) => [...jobs].filter((j) => j.state === 'queued' && j.turn !== null && j.turn !== undefined).sort(compareWall);

// Sortable columns: what of a job is compared, and whether the largest comes first at the first press.
export const kColumns = {
  name: {label: 'Name', key: (j) => (j.name || j.id).toLowerCase()},
  state: {label: 'State', key: (j) => kRank[j.state]},
  progress: {label: 'Progress', key: share, down: true},
  error: {label: 'Error', key: (j) => j.error, down: true},
  left: {label: 'Time left', key: (j) => (j.state === 'running' ? j.eta_seconds : null)},
  workers: {label: 'Workers', key: (j) => j.workers, down: true},
  integrator: {label: 'Integrator', key: (j) => j.settings.integrator},
  owner: {label: 'Owner', key: (j) => j.submitter || null},
  submitted: {label: 'Submitted', key: (j) => j.submitted_unix_ms, down: true},
  priority: {label: 'Priority', key: (j) => j.priority, down: true},
  iterations: {label: 'Iterations', key: (j) => j.iterations, down: true},
  time: {label: 'Render time', key: (j) => j.elapsed_seconds, down: true},
};

// Unknown values come last in either direction; equal ones keep the order of the list.
export function comparator(view) {
  const column = kColumns[view.sort];
  if (!column) return compareWall;
  const sign = view.down ? -1 : 1, unknown = (v) => v === null || v === undefined;
  return (a, b) => {
    const x = column.key(a), y = column.key(b);
    if (unknown(x) || unknown(y)) return unknown(x) - unknown(y) || compareWall(a, b);
    return sign * order(x, y) || compareWall(a, b);
  };
}

// A view from an address and back. What is not understood is passed over; defaults are left out.
export function parseView(search) {
  const q = new URLSearchParams(search);
  const sort = Object.hasOwn(kColumns, q.get('sort')) ? q.get('sort') : '';
  return {
    mosaic: q.get('view') === 'mosaic',
    sort,
    down: sort !== '' && (q.has('order') ? q.get('order') === 'down' : !!kColumns[sort].down),
    states: kStates.filter((s) => (q.get('state') ?? '').split(',').includes(s)),
    text: q.get('name') ?? '',
    group: q.get('group') ?? '',
  };
}
export function viewQuery(view) {
  const q = [];
  if (view.mosaic) q.push('view=mosaic');
  if (view.states.length) q.push('state=' + kStates.filter((s) => view.states.includes(s)).join(','));
  if (view.sort) q.push('sort=' + view.sort);
  if (view.sort && view.down !== !!kColumns[view.sort].down) q.push('order=' + (view.down ? 'down' : 'up'));
  if (view.text) q.push('name=' + encodeURIComponent(view.text));
  if (view.group) q.push('group=' + encodeURIComponent(view.group));
  return q.length ? '?' + q.join('&') : '';
}

// A press on a heading: this order, then the reverse, then the order of the list.
export function pressed(view, sort) {
  const down = !!kColumns[sort].down;
  if (view.sort !== sort) return {...view, sort, down};
  return view.down === down ? {...view, down: !down} : {...view, sort: '', down: false};
}

// Each word of the text is in the job's name, id, owner or integrator; a word with * or ? is a pattern of the whole name.
export function matcher(text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean).map((word) => {
    if (!/[*?]/.test(word)) return (j) => [j.name, j.id, j.submitter, j.settings.integrator].some((t) => (t ?? '').toLowerCase().includes(word));
    const pattern = new RegExp('^' + word.replace(/[.+^${}()|[\]\\]/g, '\\$&').replaceAll('*', '.*').replaceAll('?', '.') + '$', 's');
    return (j) => pattern.test(j.name.toLowerCase());
  });
  return (j) => words.every((w) => w(j));
}

// The state of a group: that of its frames that comes first here (the master's state_of).
const kGroupStates = ['running', 'queued', 'paused', 'failed', 'cancelled', 'done'];
const least = (values) => values.filter((v) => v !== null && v !== undefined).reduce((a, b) => (a === null || b < a ? b : a), null);

// One line for the frames of a group, with the fields of a job's line and `frames`, in the order of their numbers.
export function groupOf(jobs) {
  const frames = jobs.slice().sort((a, b) => a.group.frame - b.group.frame || order(a.id, b.id));
  const first = frames[0], counts = Object.fromEntries(kStates.map((s) => [s, 0]));
  let fraction = 0, workers = 0, iterations = 0;
  for (const j of frames) {
    ++counts[j.state];
    fraction += share(j) ?? 0;
    workers += j.workers ?? 0;
    iterations += j.iterations;
  }
  const state = kGroupStates.find((s) => counts[s]) ?? first.state, open = frames.filter((j) => !ended(j)), failed = frames.find((j) => j.state === 'failed');
  const finished = frames.map((j) => j.finished_unix_ms ?? 0);
  return {
    ...first, id: first.group.id, name: first.group.name, frames, counts, state, workers, iterations, iterations_asked: null, fraction: fraction / frames.length,
    priority: Math.max(...(open.length ? open : frames).map((j) => j.priority)), turn: least(frames.map((j) => (j.state === 'queued' ? j.turn : null))),
    submitted_unix_ms: least(frames.map((j) => j.submitted_unix_ms)), finished_unix_ms: open.length ? null : Math.max(...finished),
    elapsed_seconds: 0, eta_seconds: null, error: null, error_upper: null, thumbnail: null, group: null,
    message: failed ? `frame ${failed.group.frame}: ${failed.message}` : '',
  };
}

// Groups in place of their frames; those of `open` (ids) are followed by their frames.
export function fold(jobs, compare, open) {
  const groups = new Map(), rows = [];
  for (const j of jobs) {
    if (!j.group) rows.push(j);
    else if (groups.has(j.group.id)) groups.get(j.group.id).push(j);
    else groups.set(j.group.id, [j]);
  }
  for (const frames of groups.values()) rows.push(groupOf(frames));
  rows.sort(compare);
  return {rows, unfolded: (shown) => shown.flatMap((j) => (j.frames && open.has(j.id) ? [j, ...j.frames] : [j]))};
}

// Returns the lines that the view shows, in order: jobs, and groups in place of their frames but for those in `open`. `older`:
// failed ones that only the filter shows.
export function arrange(jobs, view, open = new Set()) {
  const fits = matcher(view.text), found = [], counts = Object.fromEntries(kStates.map((s) => [s, 0]));
  for (const j of jobs) {
    if ((view.group && j.group?.id !== view.group) || !fits(j)) continue;
    counts[j.state] = (counts[j.state] ?? 0) + 1;
    if (!view.states.length || view.states.includes(j.state)) found.push(j);
  }
  const compare = comparator(view);
  if (view.group) return {shown: found.sort(view.sort ? compare : (a, b) => a.group.frame - b.group.frame || order(a.id, b.id)), counts, older: 0};
  const {rows, unfolded} = fold(found, compare, open);
  let older = 0;
  const failed = rows.reduce((n, j) => n + (j.state === 'failed' ? 1 : 0), 0);
  if (!view.sort && !view.states.length && !view.text && failed > kMaxFailed) {
    older = failed - kMaxFailed;
    rows.splice(kMaxFailed, older);
  }
  return {shown: unfolded(rows), counts, older};
}
