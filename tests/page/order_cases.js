// Claims about the order, the filters and the address of the list of jobs: an expression that tells what is wrong, given the
// module order.js. test_order.py runs it in Node, test_wall.py in the browser.
(order) => {
  const wrong = [];
  const equal = (what, got, wanted) => { if (JSON.stringify(got) !== JSON.stringify(wanted)) wrong.push(`${what}: ${JSON.stringify(got)}, not ${JSON.stringify(wanted)}`); };
  const job = (id, state, more = {}) => ({id, name: id, state, submitter: '', priority: 0, share: 1, submitted_unix_ms: 0, finished_unix_ms: null, turn: state === 'queued' ? 0 : null, iterations: 0, iterations_asked: null, elapsed_seconds: 0, eta_seconds: null, error: null, error_upper: null, workers: 0, stop: {time_seconds: null, relmse: null}, ...more, settings: {integrator: 'path', ...more.settings}});
  const none = order.parseView('');
  const ids = (jobs, view = none) => order.arrange(jobs, view).shown.map((j) => j.id);

  // Failed and running jobs come first; queued jobs come in the order of their first leases.
  equal('the order of the list', ids([
    job('cancelled', 'cancelled', {finished_unix_ms: 99}), job('done-old', 'done', {finished_unix_ms: 1}), job('done-new', 'done', {finished_unix_ms: 2}),
    job('paused', 'paused'), job('later', 'queued', {turn: 5, submitted_unix_ms: 1}), job('young', 'queued', {submitted_unix_ms: 9}), job('old', 'queued', {submitted_unix_ms: 2}),
    job('urgent', 'queued', {priority: 3, turn: 100, submitted_unix_ms: 50}), job('waits', 'queued', {priority: 9, turn: null}),
    job('runs', 'running', {submitted_unix_ms: 5}), job('runs-first', 'running', {priority: 1, submitted_unix_ms: 6}), job('failed', 'failed', {finished_unix_ms: 3}), job('failed-new', 'failed', {finished_unix_ms: 4}),
  ]), ['failed-new', 'failed', 'runs-first', 'runs', 'urgent', 'old', 'young', 'later', 'waits', 'paused', 'done-new', 'done-old', 'cancelled']);

  // Many failures do not hide what runs; the filter has them all.
  const failures = [...Array(30).keys()].map((i) => job('f' + i, 'failed', {finished_unix_ms: i}));
  const whole = order.arrange([...failures, job('r', 'running')], none);
  equal('failures of the whole list', [whole.shown.at(-1).id, whole.shown.length + whole.older, whole.shown[0].id], ['r', 31, 'f29']);
  equal('failures by the filter', order.arrange(failures, order.parseView('?state=failed')).shown.length, 30);
  equal('failures of a sorted list', order.arrange(failures, order.parseView('?sort=name')).shown.length, 30);

  // A heading sorts: its own direction, the reverse, and none. Unknown values are last in both.
  const three = [job('a', 'done', {error: 2e-3}), job('b', 'running', {error: null}), job('c', 'done', {error: 5e-3})];
  let view = order.pressed(none, 'error');
  equal('one press', ids(three, view), ['c', 'a', 'b']);
  view = order.pressed(view, 'error');
  equal('two presses', ids(three, view), ['a', 'c', 'b']);
  equal('three presses', order.pressed(view, 'error').sort, '');
  equal('another heading', ids(three, order.pressed(view, 'name')), ['a', 'b', 'c']);
  for (const sort of Object.keys(order.kColumns)) equal('all jobs sorted by ' + sort, ids(three, order.pressed(none, sort)).length, 3);

  // Filters.
  const named = [job('j1', 'done', {name: 'seq010_a', submitter: 'ana@x'}), job('j2', 'running', {name: 'SEQ010_b', settings: {integrator: 'vcm'}}), job('j3', 'failed', {name: 'other.seq010'})];
  const found = (text) => ids(named, {...none, text}).sort();
  equal('a part of a name', found('seq010'), ['j1', 'j2', 'j3']);
  equal('a pattern is of the whole name', found('seq010*'), ['j1', 'j2']);
  equal('a pattern of one letter', found('seq010_?'), ['j1', 'j2']);
  equal('signs are no pattern', found('seq010.'), []);
  equal('two words', found('seq ana'), ['j1']);
  equal('an integrator', found('vcm'), ['j2']);
  equal('an id', found('j3'), ['j3']);
  equal('signs', found('(['), []);
  equal('states', ids(named, order.parseView('?state=running,done')), ['j2', 'j1']);
  equal('counts are of the text, not of the states', order.arrange(named, order.parseView('?state=done&name=seq010*')).counts.running, 1);

  // A group is one line where its frames' states and numbers say; it unfolds in the order of its frames; filters are of frames.
  const frame = (id, n, state, more = {}) => job(id, state, {...more, group: {id: 'g', name: 'shot', frame: n, frames: 3}});
  const shot = [frame('f3', 3, 'queued', {turn: 4, submitted_unix_ms: 3}), frame('f1', 1, 'done', {submitted_unix_ms: 1, iterations: 4}), frame('f2', 2, 'failed', {submitted_unix_ms: 2, message: 'no light', priority: 9}), job('runs', 'running'), job('queued', 'queued', {turn: 5})];
  equal('a folded group', ids(shot), ['runs', 'g', 'queued']);
  equal('an unfolded group', order.arrange(shot, none, new Set(['g'])).shown.map((j) => j.id), ['runs', 'g', 'f1', 'f2', 'f3', 'queued']);
  const [, folded] = order.arrange(shot, none).shown;
  equal('its figures', [folded.state, folded.priority, folded.turn, folded.submitted_unix_ms, folded.finished_unix_ms, folded.message, folded.counts.done, order.share(folded), folded.iterations], ['queued', 0, 4, 1, null, 'frame 2: no light', 1, 1 / 3, 4]);
  equal('chips count frames', order.arrange(shot, none).counts.queued, 2);
  equal('a filter of states is of frames', order.arrange(shot, order.parseView('?state=failed')).shown.map((j) => [j.id, j.frames.length]), [['g', 1]]);
  equal('a group alone', ids(shot, order.parseView('?group=g')), ['f1', 'f2', 'f3']);
  for (const [states, wanted] of [[['done', 'done'], 'done'], [['done', 'cancelled'], 'cancelled'], [['failed', 'cancelled'], 'failed'], [['paused', 'failed'], 'paused'], [['queued', 'running'], 'running']])
    equal('the state of a group ' + states, order.groupOf(states.map((s, i) => frame('f' + i, i, s))).state, wanted);

  // An address says the same when it is read and written; what it does not know it passes over.
  for (const query of ['', '?view=mosaic', '?state=failed', '?state=failed,done', '?sort=left', '?sort=left&order=down', '?sort=error&order=up', '?name=a%20b%26c', '?view=mosaic&state=paused&sort=name&name=x', '?group=g1'])
    equal('the address ' + query, order.viewQuery(order.parseView(query)), query);
  equal('a foreign address', order.viewQuery(order.parseView('?view=x&state=no,done&sort=constructor&order=down')), '?state=done');
  return wrong;
}
