// The wall of jobs: rows or a mosaic of pictures, in the order of what one wants to know first. The view is the address.
import {bar, clock, count, figure, h, put, shortWhen, when} from './dom.js';
import {get, post, stream} from './net.js';
import {arrange, kColumns, kStates, parseView, pressed, queue, share, viewQuery} from './order.js';
import {ask, choose, connected, jobPath, link, plural, saveLink} from './parts.js';
import {thumbnail} from './thumbnail.js';
import {Throughput} from './throughput.js';
import {Window} from './window.js';

const main = document.getElementById('main');
const kMaxJobs = 20000;  // that the page holds; the list of the command has all
const kTyping = 250;     // ms, after which a text is part of the address

// The jobs stay in memory while other pages are open, so that Back shows the list at once.
const jobs = new Map(), gone = new Set();
let total = 0, complete = false;

const percent = (p) => (p === null ? '' : Math.floor(100 * p) + '\u00a0%');
const leftOf = (j) => (j.state === 'running' ? clock(j.eta_seconds) : '–');
// Place of a queued job in the line for leases.
const lineOf = (place) => (place === undefined ? '' : place === 1 ? 'next' : '#' + place + ' in line');
const shortId = (id) => id.slice(0, 7);
const title = (element, text) => { if (element.title !== text) element.title = text; };

// The columns that are no text; those of `far` are for wide screens alone.
const kFar = ['priority', 'iterations', 'time'];
const kNumbers = ['error', 'left', 'workers', 'submitted', ...kFar];
const kMiddle = ['progress', 'error', 'left', 'workers'];  // in their place a failed job has its reason

// Priority, pause and cancel for all frames of a group.
function steerGroup(g) {
  const act = (verb, values) => post(`/api/groups/${encodeURIComponent(g.id)}/${verb}`, values), open = g.counts.running + g.counts.queued + g.counts.paused;
  const all = [
    {label: 'Pause', for: open > g.counts.paused, act: () => act('pause')},
    {label: 'Resume', for: g.counts.paused + g.counts.failed > 0, act: () => act('resume')},
    {label: 'Priority…', for: open > 0, act: async () => setTimeout(() => ask({title: 'Priority of ' + g.name, text: 'Higher ones go first.', fields: [{name: 'priority', label: 'Priority', inputmode: 'numeric', value: String(g.priority)}], action: 'Set'}, (v) => act('priority', v)))},
    {label: 'Cancel all', for: open > 0, danger: true, act: () => act('cancel')},
  ];
  choose(g.name, `All ${plural(g.frames.length, 'frame')} that it can be for.`, all.filter((a) => a.for));
}

// "12 of 240 frames, 3 failed"
const frameText = (g) => `${g.counts.done} of ${plural(g.frames.length, 'frame')}` + (g.counts.failed ? `, ${g.counts.failed} failed` : '');

// The line of a group: it unfolds, and steers all its frames.
function groupRow(places, toggle, open) {
  const cell = (name, ...children) => h('td', {class: 'c-' + name + (kNumbers.includes(name) ? ' num' : ''), role: 'cell'}, ...children);
  let group = null;
  const arrow = h('button', {type: 'button', class: 'fold', onclick: () => toggle(group.id)}), a = h('a', {}), note = h('span', {class: 'note'}), mark = h('span', {class: 'badge'});
  const meter = bar('Progress'), done = h('span', {class: 'pc'}), steer = h('button', {type: 'button', class: 'control steer', onclick: () => steerGroup(group)}, 'Steer…');
  const cells = {
    picture: cell('picture', arrow), name: cell('name', a, note), state: cell('state', mark), progress: cell('progress', meter, done),
    error: cell('error', '–'), left: cell('left', '–'), workers: cell('workers'), integrator: cell('integrator'), owner: cell('owner'), submitted: cell('submitted'),
    priority: cell('priority'), iterations: cell('iterations'), time: cell('time', '–'), save: cell('save', steer),
  };
  const element = h('tr', {role: 'row'}, ...Object.values(cells));
  return {
    element,
    picture: {again() {}},
    update(g, index) {
      group = g;
      const unfolded = open.has(g.id);
      element.setAttribute('aria-rowindex', index + 2);
      if (element.className !== 'job group ' + g.state) element.className = 'job group ' + g.state;
      arrow.setAttribute('aria-expanded', String(unfolded));
      arrow.setAttribute('aria-label', (unfolded ? 'Fold ' : 'Unfold ') + g.name);
      put(arrow, unfolded ? '▾' : '▸');
      const path = '/?group=' + encodeURIComponent(g.id);
      if (a.getAttribute('href') !== path) a.setAttribute('href', path);
      put(a, g.name);
      put(note, frameText(g) + (g.message ? '; ' + g.message : ''));
      title(note, note.textContent);
      put(mark, g.state);
      mark.className = 'badge ' + g.state;
      const line = g.state === 'queued' && !g.fraction, next = g.frames.map((j) => places.get(j.id)).filter(Boolean);
      meter.hidden = line;
      meter.value = g.fraction;
      meter.setAttribute('aria-label', 'Progress of ' + g.name);
      put(done, line ? lineOf(next.length ? Math.min(...next) : undefined) : percent(g.fraction));
      done.classList.toggle('note', line);
      put(cells.workers, g.workers ? String(g.workers) : '–');
      put(cells.integrator, g.settings.integrator);
      put(cells.owner, g.submitter || '–');
      put(cells.submitted, shortWhen(g.submitted_unix_ms));
      put(cells.priority, String(g.priority));
      put(cells.iterations, g.iterations ? count(g.iterations) : '–');
      steer.setAttribute('aria-label', 'Steer ' + g.name);
    },
  };
}

function jobRow(places) {
  const cell = (name, ...children) => h('td', {class: 'c-' + name + (kNumbers.includes(name) ? ' num' : ''), role: 'cell'}, ...children);
  const picture = thumbnail('small'), a = h('a', {}), id = h('code', {}), note = h('span', {class: 'note'}), mark = h('span', {class: 'badge'});
  const meter = bar('Progress'), done = h('span', {class: 'pc'}), reason = h('td', {class: 'c-reason', colspan: kMiddle.length, role: 'cell'});
  const cells = {
    picture: cell('picture', picture.element), name: cell('name', a, id, note), state: cell('state', mark), progress: cell('progress', meter, done),
    error: cell('error'), left: cell('left'), workers: cell('workers'), integrator: cell('integrator'), owner: cell('owner'), submitted: cell('submitted'),
    priority: cell('priority'), iterations: cell('iterations'), time: cell('time'), save: cell('save'),
  };
  const element = h('tr', {role: 'row'}, ...Object.values(cells));
  let saves = false, told = false;
  return {
    element,
    picture,
    update(j, index) {
      const name = j.name || j.id, failed = j.state === 'failed' && !!j.message;
      element.setAttribute('aria-rowindex', index + 2);
      if (element.className !== 'job ' + j.state) element.className = 'job ' + j.state;
      if (a.getAttribute('href') !== jobPath(j.id)) a.setAttribute('href', jobPath(j.id));
      put(a, name);
      title(a, name);
      put(id, shortId(j.id));
      title(id, j.id);
      put(note, failed ? '' : j.message);
      title(note, j.message);
      put(mark, j.state);
      mark.className = 'badge ' + j.state;
      if (told !== failed) {
        told = failed;
        if (failed) cells.state.after(reason);
        else reason.remove();
        for (const c of kMiddle) if (failed) cells[c].remove();
        if (!failed) cells.state.after(...kMiddle.map((c) => cells[c]));
      }
      put(reason, failed ? j.message : '');
      title(reason, failed ? j.message : '');
      const p = share(j), line = j.state === 'queued' && !p;
      meter.hidden = p === null || line;
      meter.value = p || 0;
      meter.setAttribute('aria-label', 'Progress of ' + name);
      put(done, line ? lineOf(places.get(j.id)) : p === null ? 'no limit' : percent(p));
      done.classList.toggle('note', line);
      put(cells.error, figure(j.error));
      title(cells.error, j.error_upper ? 'at most ' + figure(j.error_upper) : '');
      put(cells.left, leftOf(j));
      put(cells.workers, j.workers ? String(j.workers) : '–');
      put(cells.integrator, j.settings.integrator);
      put(cells.owner, j.submitter || '–');
      title(cells.owner, j.submitter);
      put(cells.submitted, shortWhen(j.submitted_unix_ms));
      title(cells.submitted, when(j.submitted_unix_ms));
      put(cells.priority, String(j.priority));
      put(cells.iterations, j.iterations ? count(j.iterations) : '–');
      put(cells.time, j.elapsed_seconds ? clock(j.elapsed_seconds) : '–');
      if (!saves && j.iterations > 0) {
        saves = true;
        cells.save.append(saveLink(j, 'exr'), saveLink(j, 'png'));
      }
      picture.update(j);
    },
  };
}

function groupTile(places) {
  const name = h('b', {}), mark = h('span', {class: 'badge'}), meter = bar('Progress'), frames = h('span', {class: 'num'}), picture = thumbnail('large');
  const a = h('a', {}, picture.element, h('span', {class: 'head'}, name, mark), meter, h('span', {class: 'foot'}, frames));
  const element = h('li', {}, a);
  return {
    element,
    picture,
    update(g) {
      element.className = 'job group ' + g.state;
      a.setAttribute('href', '/?view=mosaic&group=' + encodeURIComponent(g.id));
      put(name, g.name);
      title(a, g.name + (g.message ? '\n' + g.message : ''));
      put(mark, g.state);
      mark.className = 'badge ' + g.state;
      meter.value = g.fraction;
      meter.setAttribute('aria-label', 'Progress of ' + g.name);
      put(frames, frameText(g));
      const pictured = g.frames.find((j) => j.thumbnail);
      if (pictured) picture.update(pictured);
    },
  };
}

function jobTile(places) {
  const picture = thumbnail('large'), name = h('b', {}), mark = h('span', {class: 'badge'}), meter = bar('Progress'), left = h('span', {class: 'num'}), error = h('span', {class: 'num'}), note = h('span', {class: 'note'});
  const a = h('a', {}, picture.element, h('span', {class: 'head'}, name, mark), meter, h('span', {class: 'foot'}, left, error, note));
  const element = h('li', {}, a);
  return {
    element,
    picture,
    update(j) {
      element.className = 'job ' + j.state;
      a.setAttribute('href', jobPath(j.id));
      put(name, j.name || j.id);
      title(a, (j.name || j.id) + (j.message ? '\n' + j.message : ''));
      put(mark, j.state);
      mark.className = 'badge ' + j.state;
      const p = share(j), failed = j.state === 'failed' && !!j.message;
      meter.value = p || 0;
      meter.setAttribute('aria-label', 'Progress of ' + (j.name || j.id));
      put(note, failed ? j.message : '');
      put(left, failed ? '' : j.state === 'running' && j.eta_seconds !== null ? leftOf(j) + ' left' : j.state === 'queued' && !p ? lineOf(places.get(j.id)) : percent(p));
      put(error, failed || j.error === null ? '' : figure(j.error));
      picture.update(j);
    },
  };
}

export async function jobsPage({remember}) {
  document.title = 'Jobs – Candela';
  const began = await get('/api/throughput');  // also tells whether one may read
  let view = parseView(location.search), wall = null, over = false, typing = 0;
  const places = new Map(), open = new Set();  // unfolded groups
  const toggle = (id) => {
    if (!open.delete(id)) open.add(id);
    refresh();
  };
  const throughput = new Throughput();
  const summary = h('p', {class: 'hidden', role: 'status'});
  const chips = h('div', {class: 'chips', role: 'group', 'aria-label': 'Show jobs that are'});
  const box = h('input', {type: 'search', 'aria-label': 'Find a job', placeholder: 'Find: name, seq*, owner …', value: view.text});
  const layout = h('button', {type: 'button', class: 'layout'});
  const sorts = h('select', {class: 'sorts', 'aria-label': 'Sort'}, h('option', {value: ''}, 'Sort: what matters first'),
      ...Object.entries(kColumns).map(([name, {label}]) => h('option', {value: name}, 'Sort: ' + label)));
  const place = h('div', {class: 'place'}), more = h('p', {class: 'more'}), empty = h('p', {class: 'empty'});
  main.replaceChildren(h('div', {class: 'bar'}, h('h1', {}, 'Jobs'), chips, h('span', {class: 'right'}, box, sorts, layout)), throughput.element, summary, place, empty, more);

  // Each view has its address. `quiet`: the address of a text that is being typed replaces the one before.
  const change = (next, quiet) => {
    view = next;
    const query = viewQuery(view);
    if (query !== location.search) {
      if (quiet) history.replaceState(history.state, '', '/' + query);
      else {
        remember();
        history.pushState(null, '', '/' + query);
      }
    }
    build();
  };
  box.addEventListener('input', () => {
    view = {...view, text: box.value};
    refresh();
    clearTimeout(typing);
    typing = setTimeout(() => change(view, true), kTyping);
  });
  layout.addEventListener('click', () => change({...view, mosaic: !view.mosaic}));
  sorts.addEventListener('change', () => change({...view, sort: sorts.value, down: !!kColumns[sorts.value]?.down}));

  const chip = (state, n) => {
    const all = state === '', on = all ? !view.states.length : view.states.includes(state);
    const press = () => change({...view, states: all ? [] : on ? view.states.filter((s) => s !== state) : [...view.states, state]});
    return h('button', {type: 'button', class: 'chip ' + state, 'aria-pressed': String(on), 'data-state': state, onclick: press}, all ? 'All' : state, ' ', h('b', {}, String(n)));
  };
  let chipped = '';
  const showChips = (counts) => {
    const all = kStates.reduce((n, s) => n + counts[s], 0), key = JSON.stringify([counts, view.states]);
    if (chipped === key) return;
    chipped = key;
    const focused = chips.contains(document.activeElement) ? document.activeElement.dataset.state : null;
    chips.replaceChildren(chip('', all), ...kStates.filter((s) => counts[s] || view.states.includes(s)).map((s) => chip(s, counts[s])));
    if (focused !== null) chips.querySelector(`[data-state="${focused}"]`)?.focus();
  };

  const head = (name) => {
    const {label} = kColumns[name], sorted = view.sort === name;
    return h('th', {scope: 'col', role: 'columnheader', class: 'c-' + name + (kNumbers.includes(name) ? ' num' : ''), 'aria-sort': sorted ? (view.down ? 'descending' : 'ascending') : null},
        h('button', {type: 'button', onclick: () => change(pressed(view, name)), 'data-sort': name}, label, sorted ? h('span', {'aria-hidden': 'true'}, view.down ? ' ↓' : ' ↑') : ''));
  };
  const build = () => {
    if (wall) wall.close();
    put(layout, view.mosaic ? 'Rows' : 'Mosaic');
    layout.setAttribute('aria-label', view.mosaic ? 'Show rows' : 'Show a mosaic of pictures');
    if (box.value !== view.text) box.value = view.text;
    sorts.value = view.sort;
    const focused = place.contains(document.activeElement) ? document.activeElement.dataset.sort : null;
    if (view.mosaic) {
      const before = h('li', {class: 'space', 'aria-hidden': 'true'}), after = h('li', {class: 'space', 'aria-hidden': 'true'});
      const list = h('ul', {class: 'mosaic', 'aria-label': 'Jobs'}, before, after);
      place.replaceChildren(list);
      wall = new Window({box: list, before, after, columns: () => getComputedStyle(list).gridTemplateColumns.split(' ').length, make: (j) => (j.frames ? groupTile(places) : jobTile(places))});
    } else {
      const space = () => h('tr', {class: 'space', role: 'presentation', 'aria-hidden': 'true'}, h('td', {role: 'presentation'}));
      const before = space(), after = space(), body = h('tbody', {role: 'rowgroup'}, before, after);
      const names = ['name', 'state', ...kMiddle, 'integrator', 'owner', 'submitted', ...kFar];
      const table = h('table', {class: 'jobs', role: 'table'}, h('caption', {class: 'hidden'}, 'Jobs of this farm'),
          h('thead', {role: 'rowgroup'}, h('tr', {role: 'row', 'aria-rowindex': 1}, h('th', {scope: 'col', role: 'columnheader', class: 'c-picture'}, h('span', {class: 'hidden'}, 'Picture')), ...names.map(head), h('th', {scope: 'col', role: 'columnheader', class: 'c-save'}, 'Save'))), body);
      place.replaceChildren(table);
      wall = new Window({box: body, before, after, columns: () => 1, make: (j) => (j.frames ? groupRow(places, toggle, open) : jobRow(places))});
      if (focused) place.querySelector(`[data-sort="${focused}"]`)?.focus();
    }
    refresh();
  };

  const refresh = () => {
    if (over) return;
    const {shown, counts, older} = arrange(jobs.values(), view, open);
    places.clear();
    queue(jobs.values()).forEach((j, i) => places.set(j.id, i + 1));
    showChips(counts);
    throughput.jobs(jobs.values());
    place.querySelector('table')?.setAttribute('aria-rowcount', shown.length + 1);
    wall.show(shown);
    place.hidden = !shown.length;
    empty.hidden = shown.length > 0;
    put(empty, !complete && !jobs.size ? 'Loading …' : jobs.size ? 'No job is like this.' : 'There are no jobs. Submit one with: candela submit SCENE.xml --spp 256');
    more.replaceChildren(...(view.group ? [link('/' + viewQuery({...view, group: ''}), 'All jobs'), ' '] : []), ...(older ? [link('/?state=failed', older + ' more failed ones'), ' '] : []),
        complete ? (total > jobs.size ? `${total - jobs.size} older jobs are not here: candela list has them.` : '') : jobs.size ? `Loading ${jobs.size} of ${total} …` : '');
    more.hidden = !more.textContent;
    put(summary, `${shown.length} of ${total} jobs shown`);
  };

  // The first answer has what the wall begins with; the rest follows while one looks.
  let loading = 0;
  const load = async () => {
    const mine = ++loading, listed = new Set(), before = new Set(jobs.keys());
    for (let offset = 0;;) {
      const list = await get('/api/jobs?order=wall&offset=' + offset);
      if (over || mine !== loading) return;
      total = list.total;
      for (const j of list.jobs) {
        listed.add(j.id);
        if (!gone.has(j.id)) jobs.set(j.id, j);
      }
      offset += list.jobs.length;
      const last = !list.jobs.length || offset >= list.total || offset >= kMaxJobs;
      if (last) {
        complete = true;
        for (const id of before) if (!listed.has(id)) jobs.delete(id);
      }
      refresh();
      if (last) return;
    }
  };

  const end = stream('', {
    jobs: (data) => {
      for (const j of data) {
        if (gone.has(j.id)) continue;
        if (!jobs.has(j.id)) ++total;
        jobs.set(j.id, j);
      }
      refresh();
    },
    'jobs-gone': (ids) => {
      for (const id of ids) {
        gone.add(id);
        if (jobs.delete(id)) --total;
      }
      refresh();
    },
    thumbnails: (ids) => {
      for (const id of ids) wall.made.get(id)?.picture.again();
    },
    throughput: (t) => throughput.point(t.point, t.kept),
  }, {...connected, again: () => Promise.all([load(), get('/api/throughput').then((t) => throughput.all(t))])});
  throughput.all(began);
  build();
  // The address has changed by Back or Forward.
  const moved = () => {
    view = parseView(location.search);
    clearTimeout(typing);
    build();
  };
  return {moved, end: () => { over = true; clearTimeout(typing); wall.close(); throughput.close(); end(); }};
}
