// Keeps only the elements in sight, and some around, in the document: thousands of jobs cost as much as a screen. All elements have
// one size, which the style sheet decides.

const kAround = 8;  // lines above and below what is in sight

export class Window {
  // `box` has the elements, between `before` and `after`, which are as high as what is left out; `columns()` tells how many are
  // in a line; `make(item)` gives {element, update(item, index)}.
  constructor({box, before, after, columns, make}) {
    Object.assign(this, {box, before, after, columns, make, items: [], made: new Map(), height: 0});
    this.later = () => {
      if (!this.frame) this.frame = requestAnimationFrame(() => { this.frame = 0; this.draw(); });
    };
    addEventListener('scroll', this.later, {passive: true});
    this.observer = new ResizeObserver(() => { this.height = 0; this.later(); });
    this.observer.observe(box.parentElement);
  }
  close() {
    removeEventListener('scroll', this.later);
    this.observer.disconnect();
    cancelAnimationFrame(this.frame);
  }
  // Items have unique ids.
  show(items) {
    this.items = items;
    this.draw();
  }
  draw() {
    const perLine = Math.max(1, this.columns()), lines = Math.ceil(this.items.length / perLine);
    if (!this.height && this.items.length) {
      this.place(0, Math.min(perLine, this.items.length));
      const {element} = this.made.get(this.items[0].id), gap = parseFloat(getComputedStyle(this.box).rowGap) || 0;
      this.height = element.getBoundingClientRect().height + gap;
    }
    const height = this.height || 1, top = this.before.getBoundingClientRect().top;
    const first = Math.max(0, Math.min(lines - 1, Math.floor(-top / height)) - kAround);
    const last = Math.max(first, Math.min(lines, Math.ceil((innerHeight - top) / height) + kAround));
    this.before.style.height = first * height + 'px';
    this.after.style.height = Math.max(0, lines - last) * height + 'px';
    this.place(first * perLine, Math.min(this.items.length, last * perLine));
  }
  place(begin, end) {
    const wanted = new Set();
    for (let i = begin; i < end; ++i) wanted.add(this.items[i].id);
    for (const [id, {element}] of this.made)
      if (!wanted.has(id)) {
        element.remove();
        this.made.delete(id);
      }
    let at = this.before.nextSibling;
    for (let i = begin; i < end; ++i) {
      const item = this.items[i];
      let one = this.made.get(item.id);
      if (!one) this.made.set(item.id, one = this.make(item));
      one.update(item, i);
      if (one.element === at) at = at.nextSibling;
      else this.box.insertBefore(one.element, at);
    }
  }
}
