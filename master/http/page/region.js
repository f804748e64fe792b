// A rectangle of the picture: its numbers, the range of false color, and the command that says where its light comes from.
import {h, put, small} from './dom.js';

// A word as a shell reads it back.
const quoted = (word) => (/^[\w./:=,@%+-]+$/.test(word) ? word : "'" + word.replaceAll("'", "'\\''") + "'");

// A line of a shell, with a button that copies it.
export function commandLine(label) {
  const code = h('code', {tabindex: 0, 'aria-label': label}), said = h('span', {class: 'note', role: 'status'});
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(code.textContent);
      put(said, 'Copied.');
    } catch {  // a browser allows it on safe addresses alone
      getSelection().selectAllChildren(code);
      put(said, 'Selected: copy it with Ctrl+C.');
    }
  };
  const element = h('div', {class: 'command'}, code, h('button', {type: 'button', 'aria-label': 'Copy: ' + label, onclick: copy}, 'Copy'), said);
  return {element, show: (text) => { if (code.textContent !== text) { put(code, text); put(said, ''); } }};
}

// The pixels of a cropped job are those of the whole film; the settings of a job from another machine name no scene. What the
// job changes in the scene's light, its longest paths and its edits, the command changes too.
export function pathsCommand(job, [x0, y0, x1, y1]) {
  const {width, height, crop} = job.settings, [dx, dy] = crop ? [crop.x, crop.y] : [0, 0];
  const size = crop ? `${crop.whole_width}x${crop.whole_height}` : `${width}x${height}`;
  const {edits, integrator_settings: {max_depth}} = job.settings;
  return ['candela inspect paths', quoted(job.scene_path || 'SCENE'), '--pixels', [x0 + dx, y0 + dy, x1 + dx, y1 + dy].join(), '--size', size,
    ...(max_depth ? ['--set', quoted('max_depth=' + max_depth)] : []), ...(edits ? ['--edits', quoted(JSON.stringify(JSON.parse(edits)))] : []), '--overlay paths.png'].join(' ');
}

export class Region {
  // `viewer` shows the rectangle; `job()` is the job as it is now.
  constructor(viewer, job) {
    Object.assign(this, {viewer, job});
    const field = (label, i) => h('label', {}, label, h('input', {type: 'number', min: 0, step: 1, inputmode: 'numeric', 'aria-label': label + ' edge', onchange: (e) => {
      const at = [...viewer.region];
      at[i] = Math.round(Number(e.target.value)) || 0;
      if (i < 2) at[i + 2] = Math.max(at[i], at[i + 2]);
      else at[i - 2] = Math.min(at[i], at[i - 2]);
      viewer.setRegion(at);
    }}));
    this.fields = ['Left', 'Top', 'Right', 'Bottom'].map(field);
    this.ranged = h('input', {type: 'checkbox', id: 'ranged', onchange: () => this.range()});
    this.facts = h('p', {class: 'note', role: 'status'});
    this.command = commandLine('the command that says where this light comes from');
    this.element = h('section', {'aria-label': 'Rectangle', class: 'region', hidden: true}, h('h2', {}, 'Rectangle'),
        h('div', {class: 'fields'}, ...this.fields, h('button', {type: 'button', onclick: () => viewer.setRegion(null)}, 'Remove')), this.facts,
        h('p', {}, this.ranged, ' ', h('label', {for: 'ranged'}, 'False color over the range of the rectangle')),
        h('p', {class: 'note'}, 'Where does this light come from? On a machine that has the scene:'), this.command.element);
    viewer.onregion = () => this.show();
  }
  range() {
    const {viewer} = this, on = this.ranged.checked && viewer.region;
    if (on && !viewer.colors.on) viewer.chooseChannel();
    viewer.colors.within(on ? viewer.region : null);
  }
  async show() {
    const {viewer} = this, at = viewer.region;
    this.element.hidden = !at;
    if (this.ranged.checked || viewer.colors.pixels) this.range();
    if (!at) return;
    this.fields.forEach((f, i) => { f.lastChild.value = at[i]; });
    this.command.show(pathsCommand(this.job(), at));
    let text = `${at[2] - at[0] + 1} × ${at[3] - at[1] + 1} pixels`;
    try {
      const c = await viewer.colors.about(at);
      if (c) text += `, ${viewer.colors.on ? viewer.colors.name() : 'luminance'} ${small(c.minimum)} to ${small(c.maximum)}, mean ${small(c.mean)}`;
    } catch { /* the master is away, or has no picture yet */ }
    if (viewer.region === at) put(this.facts, text);
  }
}
