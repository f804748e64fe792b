// Parts that several pages use.
import {h, put} from './dom.js';
import {get} from './net.js';

const live = document.getElementById('live');
const dialog = document.getElementById('dialog');

function connection(text, bad) {
  put(live, text);
  live.classList.toggle('bad', bad);
}
export const connected = {
  lost: () => connection('Connection lost, trying again', true),
  found: () => connection('Live', false),
};

export const plural = (n, thing) => n + ' ' + thing + (n === 1 ? '' : 's');
export const link = (path, text) => h('a', {href: path}, text);
export const jobPath = (id) => '/jobs/' + encodeURIComponent(id);
// A job's link has its name as soon as the master has told it, once for each job.
const names = new Map();
export function namedJobLink(id) {
  const a = link(jobPath(id), id);
  if (!names.has(id)) names.set(id, get('/api' + jobPath(id) + '/name').then((j) => j.name, () => ''));
  names.get(id).then((name) => put(a, name || id));
  return a;
}
export const workerLink = (id, text = id) => link('/workers/' + encodeURIComponent(id), text);
export const badge = (state) => h('span', {class: 'badge ' + state}, state);
// A file that the browser saves. `kind`: exr or png.
export const saveLink = (j, kind, query = '') => h('a', {href: `/api${jobPath(j.id)}/image.${kind}${query}`, download: '', 'aria-label': `${kind.toUpperCase()} of ${j.name || j.id}`}, kind.toUpperCase());

// A question with fields and a button. ask({...}, async (values) => ...): an error that it throws is shown.
export function ask({title, text, fields = [], action, danger}, act) {
  const inputs = fields.map((f) => h('input', {id: 'field-' + f.name, name: f.name, type: f.type || 'text', autocomplete: 'off', inputmode: f.inputmode, value: f.value}));
  const trouble = h('p', {class: 'trouble', role: 'alert'});
  const close = () => dialog.close();
  const go = async () => {
    put(trouble, '');
    try {
      await act(Object.fromEntries(inputs.map((i) => [i.name, i.value.trim()])));
      close();
    } catch (e) {
      put(trouble, e.message);
    }
  };
  dialog.replaceChildren(
      h('h2', {id: 'dialog-title'}, title), text ? h('p', {}, text) : null,
      ...fields.map((f, i) => h('div', {class: 'field'}, h('label', {for: 'field-' + f.name}, f.label), inputs[i])), trouble,
      h('div', {class: 'buttons'}, h('button', {type: 'button', onclick: close}, 'Back'),
          h('button', {type: 'button', class: danger ? 'danger' : 'primary', id: 'dialog-go', onclick: go}, action)));
  for (const i of inputs) i.addEventListener('keydown', (e) => { if (e.key === 'Enter') { e.preventDefault(); go(); } });
  dialog.showModal();
  if (inputs.length) inputs[0].focus();
}

// A question with several answers: [{label, act, danger}]. An error that one throws is shown.
export function choose(title, text, actions) {
  const trouble = h('p', {class: 'trouble', role: 'alert'});
  const button = ({label, act, danger}) => h('button', {type: 'button', class: danger ? 'danger' : '', onclick: async () => {
    put(trouble, '');
    try {
      await act();
      dialog.close();
    } catch (e) {
      put(trouble, e.message);
    }
  }}, label);
  dialog.replaceChildren(h('h2', {id: 'dialog-title'}, title), h('p', {}, text), trouble,
      h('div', {class: 'buttons'}, h('button', {type: 'button', onclick: () => dialog.close()}, 'Back'), ...actions.map(button)));
  dialog.showModal();
}
