// The pages: one job, workers, one worker (jobs: jobs.js), and which of them is shown.
import {bar, bytes, count, duration, h, progress, prose, put, small, when} from './dom.js';
import {jobsPage} from './jobs.js';
import {ask, badge, connected, link, namedJobLink, plural, saveLink, workerLink} from './parts.js';
import {get, logIn, onToken, post, setToken, stream, unlocked} from './net.js';
import {chart} from './chart.js';
import {Mix} from './mix.js';
import {Region} from './region.js';
import {Viewer, sourceQuery} from './viewer.js';

const main = document.getElementById('main');
let controls = false;

const unlock = document.getElementById('unlock');
unlock.addEventListener('click', () => {
  if (unlocked()) {
    setToken('');
    return;
  }
  ask({title: 'Unlock controls', text: 'The token is in the file that the master was given as --page-token-file. It stays in this tab.', fields: [{name: 'token', label: 'Token', type: 'password'}], action: 'Unlock'},
      async ({token}) => {
        await post('/api/check', {}, token);
        setToken(token);
      });
});
function showLock() {
  unlock.hidden = !controls;
  put(unlock, unlocked() ? 'Lock controls' : 'Unlock controls');
  document.body.classList.toggle('unlocked', controls && unlocked());
}
onToken(showLock);

// Rows by key in a table; `make(row)` gives {element, update(row)}.
class Rows {
  constructor(body, make, order) {
    Object.assign(this, {body, make, order, rows: new Map(), gone: new Set()});
  }
  add(data) {
    let moved = false;
    for (const d of data) {
      if (this.gone.has(d.id)) continue;
      let row = this.rows.get(d.id);
      if (!row) {
        row = {...this.make(d), data: null};
        this.rows.set(d.id, row);
        moved = true;
      }
      if (!row.data || this.order(row.data) + '' !== this.order(d) + '') moved = true;
      row.data = d;
      row.update(d);
    }
    if (moved) this.sort();
  }
  // Removes the rows of `ids`.
  remove(ids) {
    for (const id of ids) {
      this.rows.get(id)?.element.remove();
      this.rows.delete(id);
    }
  }
  // Removes `ids` for good, even from a list that was made before they went.
  drop(ids) {
    for (const id of ids) this.gone.add(id);
    this.remove(ids);
  }
  sort() {
    const sorted = [...this.rows.values()].map((r) => [this.order(r.data), r.element]);
    sorted.sort(([a], [b]) => { for (let i = 0; i < a.length; ++i) if (a[i] !== b[i]) return a[i] < b[i] ? -1 : 1; return 0; });
    this.body.replaceChildren(...sorted.map(([, e]) => e));
  }
}

function table(caption, heads) {
  const body = h('tbody');
  return {body, element: h('table', {}, h('caption', {class: 'hidden'}, caption), h('thead', {}, h('tr', {}, ...heads.map((t) => h('th', {scope: 'col'}, t || h('span', {class: 'hidden'}, 'Control'))))), body)};
}

function cells(labels) {
  return labels.map((label) => h('td', {'data-label': label}));
}

function filterBox(label, rows, text) {
  const shown = h('span', {class: 'note', role: 'status'});
  const box = h('input', {type: 'search', 'aria-label': label, placeholder: label, oninput: () => apply()});
  const apply = () => {
    const wanted = box.value.toLowerCase();
    let n = 0;
    for (const row of rows().values()) {
      row.element.hidden = wanted !== '' && !text(row.data).toLowerCase().includes(wanted);
      n += row.element.hidden ? 0 : 1;
    }
    put(shown, wanted ? n + ' shown' : '');
  };
  return {element: h('div', {class: 'filter'}, box, shown), apply};
}

async function workersPage() {
  document.title = 'Workers – Candela';
  const labels = ['Worker', 'State', 'Threads', 'Units', 'Failed', 'Jobs', ''];
  const {body, element} = table('Workers of this farm', labels);
  const rows = new Rows(body, (d) => {
    const [name, state, threads, units, failed, jobs, act] = cells(labels);
    const a = workerLink(d.id, d.name || d.id), note = h('span', {class: 'note'}), mark = badge(d.state);
    name.append(a, note);
    state.append(mark);
    act.append(h('button', {type: 'button', class: 'control', 'aria-label': 'Drain ' + (d.name || d.id), onclick: () => drain(d.id, d.name || d.id)}, 'Drain'));
    let shown = '';
    return {element: h('tr', {}, name, state, threads, units, failed, jobs, act), update: (w) => {
      put(a, w.name || w.id);
      put(note, w.message || w.host);
      put(mark, w.state);
      mark.className = 'badge ' + w.state;
      put(threads, String(w.threads));
      put(units, count(w.units_merged));
      put(failed, count(w.units_failed));
      if (shown !== w.jobs.join()) {
        shown = w.jobs.join();
        jobs.replaceChildren(...w.jobs.flatMap((j, i) => [i ? ', ' : '', namedJobLink(j)]));
      }
    }};
  }, (w) => [w.state === 'lost' ? 1 : 0, w.name, w.id]);
  const filter = filterBox('Find a worker', () => rows.rows, (w) => w.name + ' ' + w.host + ' ' + w.state);
  const summary = h('p', {class: 'summary', role: 'status'});
  main.replaceChildren(h('h1', {}, 'Workers'), summary, filter.element, h('div', {class: 'scroll'}, element));
  const refresh = () => {
    const by = {};
    let threads = 0;
    for (const r of rows.rows.values()) {
      by[r.data.state] = (by[r.data.state] || 0) + 1;
      if (r.data.state !== 'lost') threads += r.data.threads;
    }
    put(summary, plural(rows.rows.size, 'worker') + ', ' + plural(threads, 'thread') + Object.entries(by).map(([s, n]) => `, ${n} ${s}`).join(''));
    filter.apply();
  };
  const load = async () => {
    const listed = (await get('/api/workers')).workers, ids = new Set(listed.map((w) => w.id));
    rows.remove([...rows.rows.keys()].filter((id) => !ids.has(id)));
    rows.add(listed);
    refresh();
  };
  await load();
  return stream('', {
    workers: (data) => { rows.add(data); refresh(); },
    'workers-gone': (ids) => { rows.drop(ids); refresh(); },
  }, {...connected, again: load});
}

function drain(id, name) {
  ask({title: 'Drain ' + name + '?', text: 'It finishes its units and leaves.', action: 'Drain'}, () => post(`/api/workers/${encodeURIComponent(id)}/drain`));
}

// Figures with labels, told by put().
function figures(names) {
  const nodes = {};
  const list = h('dl', {class: 'figures'}, ...names.map(([key, label]) => h('div', {}, h('dt', {}, label), nodes[key] = h('dd', {}, '–'))));
  return {list, nodes};
}

function section(title, ...children) {
  return h('section', {'aria-label': title}, h('h2', {}, title), ...children);
}

// `other(event)`: a link to what the page is not about; null for none.
function eventList(events, other) {
  if (events.length === 0) return h('p', {class: 'note'}, 'None.');
  return h('ol', {class: 'events', reversed: true}, ...events.slice().reverse().map((e) => {
    const link = other(e);
    return h('li', {}, h('time', {datetime: new Date(e.unix_ms).toISOString()}, when(e.unix_ms)), h('b', {}, e.kind), h('span', {}, e.message, link ? ' ' : '', link));
  }));
}
const toWorker = (e) => (e.worker ? workerLink(e.worker) : null);
const toJob = (e) => (e.job ? namedJobLink(e.job) : null);

async function jobPage(id) {
  const path = '/api/jobs/' + encodeURIComponent(id);
  const first = await get(path);
  const title = h('h1', {}), state = badge('queued'), message = h('p', {class: 'message', role: 'status'}), meter = bar('Progress'), percent = h('span', {class: 'percent'});
  const {list, nodes} = figures([['left', 'Time left'], ['error', 'Estimated relMSE'], ['iterations', 'Iterations'], ['rate', 'Samples/s'], ['elapsed', 'Render time'], ['worker', 'Time of all workers'], ['leased', 'Units under way'], ['memory', 'Memory of a worker'], ['priority', 'Priority'], ['rejected', 'Rejected samples']]);
  const act = (verb, values) => post(`${path}/${verb}`, values);
  const say = async (f) => { try { await f(); } catch (e) { ask({title: 'It did not work', text: e.message, action: 'Well'}, async () => {}); } };
  const buttons = {
    pause: h('button', {type: 'button', class: 'control', onclick: () => say(() => act('pause'))}, 'Pause'),
    resume: h('button', {type: 'button', class: 'control', onclick: () => say(() => act('resume'))}, 'Resume'),
    extend: h('button', {type: 'button', class: 'control', onclick: () => ask({title: 'Extend', text: 'Fill in one or more.', fields: [{name: 'iterations', label: 'Iterations more', inputmode: 'numeric'}, {name: 'minutes', label: 'Minutes more', inputmode: 'decimal'}, {name: 'relmse', label: 'Stop at a relMSE of at most', inputmode: 'decimal'}], action: 'Extend'},
        ({iterations, minutes, relmse}) => act('extend', {iterations, seconds: minutes ? String(60 * Number(minutes)) : '', relmse}))}, 'Extend…'),
    priority: h('button', {type: 'button', class: 'control', onclick: () => ask({title: 'Priority', text: 'Higher ones go first.', fields: [{name: 'priority', label: 'Priority', inputmode: 'numeric', value: String(job.priority)}], action: 'Set'}, (v) => act('priority', v))}, 'Priority…'),
    cancel: h('button', {type: 'button', class: 'control danger', onclick: () => ask({title: 'Cancel this job?', text: 'It keeps the image of what is merged, and can be extended later.', action: 'Cancel the job', danger: true}, () => act('cancel'))}, 'Cancel…'),
  };
  const plot = h('div', {class: 'plot'}), plotText = h('p', {class: 'note'}), luck = h('p', {class: 'note'});
  let axis = 'iterations', convergence = [], job = first, end = null;
  const choose = (a, text) => h('button', {type: 'button', 'aria-pressed': String(a === axis), onclick: (e) => {
    axis = a;
    for (const b of e.target.parentElement.children) b.setAttribute('aria-pressed', String(b === e.target));
    drawPlot();
  }}, text);
  let plotted = '';
  const drawPlot = () => {
    const key = [axis, job.stop.relmse, job.iterations_asked, job.stop.time_seconds, convergence.length, convergence.at(-1)].join();
    if (key === plotted) return;
    plotted = key;
    const {svg, text} = chart(job, convergence, axis);
    plot.replaceChildren(...(svg ? [svg] : []));
    prose(plotText, text);
  };
  const shares = h('div', {}), events = h('div', {}), plan = h('pre', {tabindex: 0, 'aria-label': 'Plan'}), settings = h('dl', {class: 'settings'});
  const chains = section('Markov chains'), epochs = section('Epochs');
  chains.hidden = epochs.hidden = true;
  const chainFacts = h('p', {}), mutationFacts = h('dl', {class: 'settings'}), groups = h('div', {class: 'groups'}), epochFacts = h('p', {}), epochTable = h('dl', {class: 'settings'});
  chains.append(chainFacts, groups, mutationFacts);
  epochs.append(epochFacts, epochTable);
  const viewer = new Viewer(id), region = new Region(viewer, () => job);
  const mix = viewer.mix = new Mix(id, () => {
    if (viewer.kind === 'mix') viewer.recolor();
    else viewer.choose('mix');
  });
  viewer.onlayers = (partition) => mix.setNames(partition);
  // The PNG is exposed as the picture is.
  const png = saveLink(first, 'png'), saves = h('span', {class: 'saves'}, 'Save ', saveLink(first, 'exr'), ' ', png);
  png.addEventListener('click', () => png.setAttribute('href', `/api/jobs/${encodeURIComponent(id)}/image.png` + (viewer.kind === 'image' && viewer.exposure ? '?exposure=' + viewer.exposure : '')));
  main.replaceChildren(
      h('div', {class: 'jobhead'}, h('div', {}, title, state, saves), h('div', {class: 'buttons'}, ...Object.values(buttons))), message,
      h('div', {class: 'overall'}, meter, percent),
      h('div', {class: 'columns'}, h('div', {class: 'side'}, h('div', {class: 'stagebox'}, viewer.element), region.element, mix.element, section('Events', events)),
          h('div', {class: 'side'}, list, section('Convergence', h('div', {class: 'switch', role: 'group', 'aria-label': 'Horizontal axis'}, choose('iterations', 'Iterations'), choose('seconds', 'Time')), plot, plotText, luck), section('Workers’ share', shares))),
      h('div', {class: 'below'}, chains, epochs, section('Plan', plan), section('Settings', settings)));
  let settingsShown = '';
  const show = (j) => {
    job = j;
    document.title = (j.name || j.id) + ' – Candela';
    put(title, j.name || j.id);
    put(state, j.state);
    state.className = 'badge ' + j.state;
    put(message, j.message);
    const p = j.state === 'done' ? 1 : progress(j);
    meter.hidden = p === null;
    meter.value = p || 0;
    saves.hidden = !j.iterations;
    put(percent, p === null ? 'No limit is set' : Math.floor(100 * p) + ' %');
    put(nodes.left, j.state === 'running' ? duration(j.eta_seconds) : '–');
    prose(nodes.error, small(j.error) + (j.error_upper ? ', at most ' + small(j.error_upper) : ''));
    put(nodes.iterations, count(j.iterations) + (j.iterations_asked ? ' of ' + count(j.iterations_asked) : ''));
    put(nodes.rate, count(j.samples_per_second));
    put(nodes.elapsed, duration(j.elapsed_seconds) + (j.stop.time_seconds ? ' of ' + duration(j.stop.time_seconds) : ''));
    put(nodes.worker, duration(j.worker_seconds));
    put(nodes.leased, count(j.units_leased));
    put(nodes.memory, bytes(j.worker_memory_bytes));
    put(nodes.priority, j.priority + (j.share !== 1 ? ', share ' + small(j.share) : ''));
    put(nodes.rejected, count(Object.entries(j.rejected_samples).reduce((a, [cause, n]) => a + (cause === 'statistics' ? 0 : n), 0)));
    const ended = ['done', 'failed', 'cancelled'].includes(j.state);
    buttons.pause.hidden = ended || j.state === 'paused';
    buttons.resume.hidden = j.state !== 'paused' && j.state !== 'failed';
    buttons.cancel.hidden = ended;
    buttons.priority.hidden = ended;
    const unseen = j.plan.split('\n').filter((line) => line.startsWith('note light ')).map((line) => line.slice(5));
    put(luck, unseen.length ? 'The error may leave out ' + unseen.join('; ') : '');
    put(plan, j.plan || 'The plan comes with the first unit.');
    const {indices, iterations, time_seconds, relmse} = j.stop;
    const s = j.settings, facts = [['Job', j.id], ['Submitter', j.submitter || 'unknown'], ['Integrator', s.integrator], ...Object.entries(s.integrator_settings), ['Size', `${s.width} × ${s.height}` + (s.crop ? ` at ${s.crop.x}, ${s.crop.y} of ${s.crop.whole_width} × ${s.crop.whole_height}` : '')], ['Filter', s.filter], ...Object.entries(s.filter_settings), ['Sampler', s.sampler], ['Seed', s.seed], ['Instruction set', s.isa], ['AOVs', s.aovs || 'none'],
      ['Stop', [indices ? 'exactly the indices ' + (indices.length > 120 ? indices.slice(0, 120) + '...' : indices) : iterations ? count(j.iterations_asked) + ' iterations' : '', time_seconds ? duration(time_seconds) : '', relmse ? 'relMSE at most ' + small(relmse) : ''].filter(Boolean).join(', ') || 'never'],
      ['Submitted', when(j.submitted_unix_ms)], ...(j.finished_unix_ms ? [['Finished', when(j.finished_unix_ms)]] : []), ['On disk', count(j.checkpoint.iterations) + ' iterations'], ['Scene', j.bundle_sha256.slice(0, 16)]];
    if (settingsShown !== String(facts)) {
      settingsShown = String(facts);
      settings.replaceChildren(...facts.map(([k, v]) => h('div', {}, h('dt', {}, k), h('dd', {}, v))));
    }
    chains.hidden = !j.chains;
    if (j.chains) {
      const c = j.chains;
      prose(chainFacts, !c.chains ? 'Mutations of short chains' : `${count(c.chains)} chains; bootstrap ${count(c.bootstrap_done)} of ${count(c.bootstrap_samples)} samples; ` + (c.b === null ? 'b is not known yet' : `b = ${small(c.b)} ± ${small(c.b_standard_error)}`));
      groups.replaceChildren(...(c.chains ? c.groups : []).map((g, i) => h('span', {}, h('b', {}, String(i)), ' ', g.mutations ? Math.round((100 * g.accepted) / g.mutations) + ' %' : '–', h('small', {}, 'stay ' + count(g.longest_stay)))));
      mutationFacts.replaceChildren(...Object.entries(c.by_mutation ?? {}).filter(([, m]) => m.proposed).map(([name, m]) => {
        const share = (n) => Math.round((100 * n) / m.proposed) + ' %';
        const failed = Object.entries(m.failed).filter(([, n]) => n).map(([cause, n]) => `${cause.replaceAll('_', ' ')} ${share(n)}`);
        return h('div', {}, h('dt', {}, name), h('dd', {}, `${share(m.accepted)} accepted${failed.length ? '; failed: ' + failed.join(', ') : ''}; ${(m.rays / m.proposed).toFixed(1)} rays each`));
      }));
    }
    epochs.hidden = !j.epochs;
    if (j.epochs) {
      put(epochFacts, `Epoch ${j.epochs.epoch} is decided: ${count(j.epochs.iterations)} iterations from ${count(j.epochs.first_iteration)}; ${bytes(j.epochs.statistics_bytes)} of statistics`);
      epochTable.replaceChildren(...Object.entries(j.epochs.figures).map(([name, value]) => h('div', {}, h('dt', {}, name), h('dd', {}, small(value)))));
    }
    drawPlot();
  };
  const details = (d) => {
    convergence = d.convergence;
    drawPlot();
    const all = d.shares.reduce((a, s) => a + s.seconds, 0);
    shares.replaceChildren(d.shares.length ? h('ul', {class: 'shares'}, ...d.shares.sort((a, b) => b.seconds - a.seconds).slice(0, 40).map((s) => {
      const meter = h('progress', {max: 1, value: all ? s.seconds / all : 0, 'aria-hidden': 'true'});
      return h('li', {}, workerLink(s.worker, s.name || s.worker), meter, h('span', {}, (all ? Math.round((100 * s.seconds) / all) : 0) + '\u00a0%'), h('span', {class: 'note'}, count(s.units) + ' units'));
    })) : h('p', {class: 'note'}, 'Nothing is merged yet.'));
    events.replaceChildren(eventList(d.events, toWorker));
  };
  const open = (source) => {
    if (end) end();
    const mine = () => viewer.source === source;  // an event may come after its stream was left
    end = stream('job=' + encodeURIComponent(id) + '&' + sourceQuery(source),
        {job: show, details, picture: (p) => mine() && viewer.picture(p), nopicture: (p) => mine() && viewer.none(p.message)}, {...connected, again: () => {}});
  };
  viewer.onsource = open;
  show(first);
  open(viewer.source);
  return () => { end(); viewer.close(); };
}

async function workerPage(id) {
  const first = await get('/api/workers/' + encodeURIComponent(id));
  const title = h('h1', {}), state = badge('idle'), message = h('p', {class: 'message', role: 'status'}), events = h('div', {}), jobs = h('p', {});
  const {list, nodes} = figures([['host', 'Host'], ['threads', 'Threads'], ['units', 'Units merged'], ['failed', 'Units failed'], ['memory', 'Memory'], ['seen', 'Last seen'], ['build', 'Build']]);
  main.replaceChildren(h('div', {class: 'jobhead'}, h('div', {}, title, state), h('div', {class: 'buttons'}, h('button', {type: 'button', class: 'control', onclick: () => drain(id, title.textContent)}, 'Drain…'))),
      message, list, section('Jobs', jobs), section('Events', events));
  let shown = null;
  const show = (w) => {
    document.title = (w.name || w.id) + ' – Candela';
    put(title, w.name || w.id);
    put(state, w.state);
    state.className = 'badge ' + w.state;
    put(message, w.message);
    put(nodes.host, w.host);
    put(nodes.threads, String(w.threads));
    put(nodes.units, count(w.units_merged));
    put(nodes.failed, count(w.units_failed) + Object.entries(w.failures).map(([k, n]) => (n ? `, ${k} ${n}` : '')).join(''));
    put(nodes.memory, bytes(w.resident_bytes));
    put(nodes.seen, when(w.last_seen_unix_ms));
    put(nodes.build, w.build_id);
    if (shown !== w.jobs.join()) {
      shown = w.jobs.join();
      jobs.replaceChildren(...(w.jobs.length ? w.jobs.flatMap((j, i) => [i ? ', ' : '', namedJobLink(j)]) : ['None now.']));
    }
  };
  show(first);
  return stream('worker=' + encodeURIComponent(id), {worker: show, events: (e) => events.replaceChildren(eventList(e, toJob))}, {...connected, again: () => {}});
}

// Routes. Links change the page without loading it anew; Back finds the place where one was.
let shown = null, visit = 0, scrolled = 0;  // shown: what ends the page, or {end, moved}
history.scrollRestoration = 'manual';
const remember = () => history.replaceState({...history.state, y: scrollY}, '');
addEventListener('scroll', () => {
  if (!scrolled) scrolled = setTimeout(() => { scrolled = 0; remember(); }, 300);
}, {passive: true});
async function route() {
  const path = location.pathname;
  if (path === '/' && shown?.moved) return shown.moved();
  const mine = ++visit;
  if (shown) (shown.end ?? shown)();
  shown = null;
  const page = path === '/' ? () => jobsPage({remember}) : path === '/workers' ? workersPage : path.startsWith('/jobs/') ? () => jobPage(decodeURIComponent(path.slice(6))) : () => workerPage(decodeURIComponent(path.slice(9)));
  for (const a of document.querySelectorAll('[data-nav]')) {
    const here = path.startsWith('/workers') ? 'workers' : 'jobs';
    if (a.dataset.nav === here) a.setAttribute('aria-current', path === '/' || path === '/workers' ? 'page' : 'true');
    else a.removeAttribute('aria-current');
  }
  try {
    const end = await page();
    if (mine === visit) shown = end;
    else (end.end ?? end)();
  } catch (e) {
    if (mine !== visit) return;
    if (e.code === 401) return askForToken();
    main.replaceChildren(h('h1', {}, 'Not here'), h('p', {}, e.message), h('p', {}, link('/', 'All jobs')));
    if (e instanceof TypeError) setTimeout(() => { if (mine === visit) route(); }, 2000);
  }
}
document.addEventListener('click', (e) => {
  const a = e.target.closest('a');
  if (!a || a.origin !== location.origin || a.hash || a.hasAttribute('download') || e.button || e.metaKey || e.ctrlKey || e.shiftKey) return;
  e.preventDefault();
  remember();
  history.pushState(null, '', a.href);
  Promise.resolve(route()).then(() => main.focus({preventScroll: true}));
  scrollTo(0, 0);
});
addEventListener('popstate', (e) => {
  clearTimeout(scrolled);
  scrolled = 0;
  const y = e.state?.y ?? 0;
  Promise.resolve(route()).then(() => scrollTo(0, y));
});

function askForToken() {
  main.replaceChildren(h('h1', {}, 'Whose farm is this?'), h('p', {}, 'Reading needs the master’s token: the file “token” in its data folder.'),
      h('p', {}, h('button', {type: 'button', onclick: askForToken}, 'Give the token')));
  ask({title: 'Read this farm', text: 'The token is in the file “token” of the master’s data folder. This browser keeps a sign that it was shown.', fields: [{name: 'token', label: 'Token', type: 'password'}], action: 'Read'},
      async ({token}) => {
        await logIn(token);
        start();
      });
}

function start() {
  get('/api/farm').then((farm) => {
    controls = farm.controls;
    showLock();
  }).catch((e) => { if (e.code !== 401) connected.lost(); });
  route();
}

// An address with #token=... opens the page without a question; the token leaves the address.
const given = new URLSearchParams(location.hash.slice(1)).get('token');
if (given) {
  history.replaceState(null, '', location.pathname + location.search);
  logIn(given).then(start, start);
} else {
  start();
}
