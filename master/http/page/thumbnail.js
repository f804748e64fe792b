// A small picture of a job, which the browser keeps by its revision. It stays until the next one is there.
import {h} from './dom.js';

const kRetry = 20e3;  // the master says when it has made one; this is for what it did not say

export function thumbnail(size) {
  const element = h('span', {class: 'thumb'});
  let shown = '', job = null, tries = 0, timer = 0, loading = null;
  const load = () => {
    clearTimeout(timer);
    const revision = job.thumbnail, image = h('img', {alt: '', decoding: 'async', draggable: 'false'});
    loading = image;
    image.addEventListener('load', () => {
      if (loading !== image) return;
      element.replaceChildren(image);
    });
    image.addEventListener('error', () => {
      if (loading === image && element.isConnected) timer = setTimeout(() => element.isConnected && load(), kRetry);
    });
    image.src = `/api/jobs/${encodeURIComponent(job.id)}/thumbnail?size=${size}&revision=${encodeURIComponent(revision)}` + (tries ? '&try=' + tries : '');
    ++tries;
  };
  return {
    element,
    update(j) {
      job = j;
      if (!j.thumbnail || shown === j.thumbnail) return;
      shown = j.thumbnail;
      tries = 0;
      load();
    },
    // There is a new one.
    again() {
      if (job?.thumbnail) load();
    },
  };
}
