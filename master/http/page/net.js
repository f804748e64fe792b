// Calls, the stream of events, and the token.
const listeners = new Set();
let token = sessionStorage.getItem('candela-token') || '';

export function unlocked() {
  return token !== '';
}

export function onToken(f) {
  listeners.add(f);
}

export function setToken(text) {
  token = text;
  if (text) sessionStorage.setItem('candela-token', text);
  else sessionStorage.removeItem('candela-token');
  for (const f of listeners) f();
}

// A seed has up to 64 bits, more than a number of a script.
const parse = (text) => JSON.parse(text.replace(/"seed":(\d+)/g, '"seed":"$1"'));

export async function get(path) {
  const answer = await fetch(path, {cache: 'no-store'});
  if (!answer.ok) throw Object.assign(new Error((await answer.text()).trim()), {code: answer.status});
  return parse(await answer.text());
}

// Gets the cookie that lets this browser read. It changes nothing, so that another site gains nothing by it.
export const logIn = (given) => post('/api/login', {}, given);

// The header, not a cookie, carries the token: no other site can make a browser send it.
export async function post(path, values = {}, given = token) {
  const answer = await fetch(path, {
    method: 'POST',
    cache: 'no-store',
    headers: {Authorization: 'Bearer ' + given},
    body: new URLSearchParams(values),
  });
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

// handlers: {kind: f(data)}; `lost` and `found` tell of the connection. `again` is called at each new one, since events
// before it were not sent. Hidden pages hold no connection. Returns a function that ends it.
export function stream(query, handlers, {lost, found, again}) {
  let source = null, timer = 0, over = false;
  const open = () => {
    clearTimeout(timer);
    if (over || source || document.hidden) return;
    const mine = source = new EventSource('/api/stream?' + query);
    source.addEventListener('hello', async () => {
      found();
      try {
        await again();
      } catch {  // the master is gone already: the next connection asks again
        if (over || source !== mine) return;
        close();
        lost();
        timer = setTimeout(open, 2000);
      }
    });
    for (const [kind, f] of Object.entries(handlers))
      source.addEventListener(kind, (e) => f(parse(e.data)));
    source.onerror = () => {
      lost();
      if (source && source.readyState === EventSource.CLOSED) {
        source = null;
        timer = setTimeout(open, 2000);
      }
    };
  };
  const close = () => {
    if (source) source.close();
    source = null;
    clearTimeout(timer);
  };
  const visible = () => (document.hidden ? close() : open());
  document.addEventListener('visibilitychange', visible);
  addEventListener('pagehide', close);
  open();
  return () => {
    over = true;
    document.removeEventListener('visibilitychange', visible);
    removeEventListener('pagehide', close);
    close();
  };
}
