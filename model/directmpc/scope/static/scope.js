// The page of the scope: the connection, trigger, cursors, settings, presets and exports. docs/scope.md is its manual.
import { Store, KEPT } from './store.js';
import { View, viewsOf } from './views.js';

const $ = (id) => document.getElementById(id);
const HISTORY = 20; // steps before a trip that a click on it shows
const RECORDED = 1024; // steps of a board's recorder at most

const page = {
  store: null, own: null, hello: null, views: [], unit: 0, dirty: true, marks: { a: null, b: null, t: null }, dragged: false,
  view: { from: 0, until: 1000, follows: true }, span: 1000, trigger: { armed: false, row: 0, since: 0 }, frames: 0, fps: 0, thd: NaN, messages: 0, bytes: 0,
  state: { running: false, events: [], rows: 0 }, settings: [], orders: new Map(), number: 0, ready: false,

  channel(key) { return this.store.channels[this.store.place.get(key)] || this.store.channels[0]; },
  gateName(n) { const width = this.hello.gates / 3; return `${'abc'[Math.floor(n / width)]} ${width === 8 ? 'S' + (n % width + 1) : ['upper', 'lower'][n % 2]}`; },
  faultNames(until) { const word = this.store.at('faults', Math.min(until, this.store.total) - 1); return this.hello.faults.filter((_, n) => word >> n & 1).join(', ') || ' none'; },
  // The least time between a gate that goes off and the next one of its leg that comes on.
  deadTime(from, until) {
    const width = this.hello.gates / 3, edges = this.store.edgesIn(from, until);
    let least = Infinity;
    for (let leg = 0; leg < 3; leg++) {
      let off = null, before = edges[0][1];
      for (const [time, word] of edges.slice(1)) {
        const mask = (2 ** width - 1) * 2 ** (leg * width);
        const went = before & ~word & mask, came = word & ~before & mask;
        if (came && off !== null) { least = Math.min(least, time - off); off = null; }
        if (went) off = time;
        before = word;
      }
    }
    return least < 1e-3 ? `${(least * 1e6).toFixed(2)} µs` : '–';
  },
  zoom(from, until) {
    if (until - from < 5) { const middle = (from + until) / 2; from = middle - 2.5; until = middle + 2.5; }
    this.view = { from: Math.round(from), until: Math.round(until), follows: false };
    this.shown();
  },
  scale(factor, around = null) {
    const { from, until } = this.window();
    const centre = around ?? (this.view.follows ? until : (from + until) / 2);
    const size = Math.max(5, Math.min(this.store.capacity, (until - from) * factor));
    if (this.view.follows) { this.span = Math.round(size); $('span').value = this.span; this.dirty = true; return; }
    const share = (centre - from) / (until - from);
    this.zoom(centre - share * size, centre + (1 - share) * size);
  },
  follow() { this.store = this.own; this.view.follows = true; this.marks.t = null; this.shown(); },
  window() {
    if (!this.view.follows) return { from: this.view.from, until: this.view.until };
    const until = Math.max(this.store.total, this.span);
    return { from: until - this.span, until };
  },
  shown() {
    $('hold').setAttribute('aria-pressed', String(!this.view.follows));
    $('title').textContent = this.hello.title + (this.store.recording ? ' · recorder' : '');
    this.dirty = true;
  },
  place(name, row) { this.marks[name] = Math.round(row); this.dirty = true; },
};
window.directmpc = page; // for tests and the console

// ---- the connection ----

function opened(recording = '') {
  const address = new URL('ws', location.href), found = new URLSearchParams(location.search);
  address.protocol = address.protocol.replace('http', 'ws');
  if (recording) found.set('recording', recording);
  address.search = found;
  return Object.assign(new WebSocket(address), { binaryType: 'arraybuffer' });
}

let socket;
function connect() {
  socket = opened();
  socket.onmessage = ({ data }) => { page.messages++; if (typeof data === 'string') told(JSON.parse(data)); else taken(data); };
  socket.onclose = () => {
    page.ready = false;
    status('not connected; the drive is off', 'fault');
    for (const { no } of page.orders.values()) no(new Error('not connected'));
    page.orders.clear();
    setTimeout(connect, 1000);
  };
}

function taken(data) {
  page.bytes += data.byteLength;
  const [from, count] = filled(page.own, data);
  if (count) {
    if (!page.hello.live && from === page.own.first) page.zoom(from, from + Math.min(1000, Math.max(20, count)));
    triggered();
  }
  page.dirty = true;
}

// Rows or edges into a store; first and number of the rows.
function filled(store, data) {
  const [kind, from, count, channels] = new Uint32Array(data, 0, 4);
  if (kind === 1) { store.add(from, count, new Float32Array(data, 16, count * channels)); return [from, count]; }
  store.addEdges(new Float64Array(data, 16, count), new Uint32Array(data, 16 + 8 * count, count));
  return [0, 0];
}

// What the board's recorder held: a store of its own, fetched once.
const recordings = new Map();
function recording(number) {
  if (!recordings.has(number)) recordings.set(number, new Promise((yes, no) => {
    const from = opened(number);
    let store;
    from.onclose = ({ reason }) => { recordings.delete(number); no(new Error(reason || 'not connected')); };
    from.onmessage = ({ data }) => {
      if (typeof data !== 'string') { filled(store, data); return; }
      const { hello, state } = JSON.parse(data);
      if (hello) store = Object.assign(new Store(hello.channels, hello.ts, RECORDED), { recording: number });
      if (state) { from.onclose = null; from.close(); yes(store); }
    };
  }));
  return recordings.get(number);
}

// The steps before an event.
async function look(event) {
  try { page.store = event.recording ? await recording(event.recording) : page.own; } catch ({ message }) { say(message); return; }
  page.marks.t = event.row;
  page.zoom(event.row - HISTORY, event.row + 2);
}

function told(message) {
  if (message.hello) return begin(message.hello);
  if (message.state) {
    page.state = { ...page.state, ...message.state };
    triggered();
    return stated();
  }
  const order = page.orders.get(message.number);
  page.orders.delete(message.number);
  if (message.settings) settings(message.settings);
  if (message.presets) presets(message.presets);
  if (message.error) { say(message.error); order?.no(new Error(message.error)); } else { say(''); order?.yes(); }
}

function order(what, more = {}) {
  return new Promise((yes, no) => {
    if (socket.readyState !== 1) { say('not connected'); no(new Error('not connected')); return; }
    const number = ++page.number;
    page.orders.set(number, { yes, no });
    socket.send(JSON.stringify({ do: what, number, ...more }));
  }).catch(() => false);
}

function say(text) { $('message').textContent = text; $('message').hidden = !text; }
function status(text, kind = '') { $('status').textContent = text; $('status').className = kind; }

function stated() {
  const { running, error, rate, events = [], rows } = page.state;
  const last = events.findLast((event) => event.kind !== 'recorder');
  if (!page.hello.live) status(`${rows} steps recorded`);
  else if (running) status(`running, ${rate || '…'} steps/s`, 'on');
  else if (error) status(`off: ${error}`, 'fault');
  else if (last && (last.kind === 'trip' || last.kind === 'fault')) status(`tripped: ${last.names.join(', ')}`, 'fault');
  else status('off');
  $('start').setAttribute('aria-disabled', String(running)); // not disabled: it keeps the keyboard
  const key = JSON.stringify(events);
  if (key === page.known) return;
  page.known = key;
  $('none').hidden = events.length > 0;
  $('events').replaceChildren(...[...events].reverse().map((event) => {
    const item = document.createElement('li'), button = document.createElement('button');
    button.className = event.kind;
    button.textContent = `${event.kind} ${event.names.join(', ')}${event.recording ? `: ${event.rows} steps` : ` at ${(event.row * page.own.ts).toFixed(4)} s`}`;
    button.onclick = () => look(event);
    item.append(button);
    return item;
  }));
}

// ---- settings ----

function settings(list) {
  page.settings = list;
  const parts = [];
  for (const kind of ['reference', 'parameter']) {
    const own = list.filter((s) => s.kind === kind);
    if (!own.length) continue;
    const head = document.createElement('h2');
    head.textContent = kind === 'reference' ? 'References' : 'Parameters';
    parts.push(head);
    for (const s of own) {
      const [unit, factor] = s.units[page.unit], box = document.createElement('div');
      box.className = 'setting';
      box.innerHTML = '<label></label><input type="number" step="any"><input type="range">';
      const [label, number, range] = box.children;
      label.textContent = unit ? `${s.label}, ${unit}` : s.label;
      label.htmlFor = number.id = `set-${s.key}`;
      range.setAttribute('aria-label', s.label);
      range.id = `slide-${s.key}`;
      range.step = s.whole ? 1 : (s.high - s.low) * factor / 400;
      for (const input of [number, range]) { input.min = s.low * factor; input.max = s.high * factor; }
      number.value = +(s.value * factor).toPrecision(6);
      range.value = s.value * factor;
      range.oninput = () => { number.value = +(+range.value).toPrecision(6); if (s.kind === 'reference') set({ [s.key]: range.value / factor }); else box.classList.add('changed'); };
      number.onchange = () => { range.value = number.value; if (s.kind === 'reference') set({ [s.key]: number.value / factor }); else box.classList.add('changed'); };
      parts.push(box);
    }
    if (kind === 'parameter') {
      const button = document.createElement('button');
      button.id = 'commit';
      button.textContent = 'Commit';
      button.title = 'all changed parameters take effect together, between two decisions';
      button.onclick = () => {
        const values = {};
        for (const s of own) {
          const number = $(`set-${s.key}`);
          if (number.parentElement.classList.contains('changed')) values[s.key] = s.whole ? Math.round(number.value) : number.value / s.units[page.unit][1];
        }
        if (Object.keys(values).length) order('set', { values });
      };
      parts.push(button);
    }
  }
  if (document.activeElement?.closest('#settings') && document.activeElement.type === 'range' && $('settings').children.length) return; // a slider in hand stays
  $('settings').replaceChildren(...parts);
}

let waiting = null, under = false;
async function set(values) {
  waiting = { ...waiting, ...values };
  if (under) return;
  under = true;
  while (waiting) { const values_ = waiting; waiting = null; await order('set', { values: values_ }); }
  under = false;
}

// ---- trigger ----

const CONDITIONS = { fault: (k) => page.own.at('faults', k) > 0, deadlock: (k) => page.own.at('deadlock', k) > 0, saturated: (k) => page.own.at('saturated', k) > 0 };

function arm(mode) {
  page.trigger = { armed: mode !== 'off', row: -1, since: page.hello.live ? page.own.total : page.own.first };
  $('mode').value = mode;
  if (mode !== 'off') page.follow();
  armed();
  triggered();
}
function armed() { $('armed').textContent = $('mode').value === 'off' ? '' : page.trigger.row >= 0 ? 'triggered' : 'armed'; }

function triggered() {
  const t = page.trigger, store = page.own, mode = $('mode').value;
  if (mode === 'off' || (!t.armed && t.row < 0)) return;
  const after = Math.round(page.span * (1 - $('before').value / 100));
  if (t.row < 0) {
    const source = $('source').value, test = CONDITIONS[source], up = $('edge').value === 'up';
    const level = $('level').value / (test ? 1 : page.channel(source).units[page.unit][1]);
    const over = test ? test : (k) => (up ? store.at(source, k) >= level : store.at(source, k) <= level);
    for (let k = Math.max(t.since, store.first + 1); k < store.total; k++) {
      if (over(k) && !over(k - 1)) { t.row = k; t.armed = false; break; }
    }
    t.since = store.total;
    armed();
  }
  if (t.row >= 0 && (store.total >= t.row + after || !page.state.running)) {
    page.store = store;
    page.marks.t = t.row;
    page.zoom(t.row + after - page.span, t.row + after);
    if (mode === 'normal') page.trigger = { armed: true, row: -1, since: store.total };
    else t.row = -2;
  }
}

// ---- the frame ----

let drawn = 0;
function frame(now) {
  requestAnimationFrame(frame);
  if (!page.store || !page.dirty || now - drawn < 25) return;
  drawn = now;
  page.dirty = false;
  const { from, until } = page.window(), ts = page.store.ts;
  const xs = new Float64Array(Math.max(2, until - from));
  for (let k = 0; k < xs.length; k++) xs[k] = (from + k) * ts;
  for (const view of page.views) view.draw(from, from + xs.length, xs);
  page.frames++;
  page.listed = false;
}
setInterval(() => { page.fps = page.frames - (page.counted || 0); page.counted = page.frames; $('fps').textContent = `${page.fps} frames/s`; }, 1000);

setInterval(() => { if (page.store && !page.listed) cursors(); }, 200);

function cursors() {
  page.listed = true;
  const { a, b } = page.marks, store = page.store;
  if (a === null && b === null) { $('cursors').replaceChildren(); return; }
  const rows = [['', 'A', 'B', 'B − A', 'mean', 'rms']], short = (v) => (Number.isFinite(v) ? +v.toPrecision(4) : '');
  rows.push(['s', a === null ? '' : short(a * store.ts), b === null ? '' : short(b * store.ts), a === null || b === null ? '' : short((b - a) * store.ts), '', '']);
  const listed = new Set(page.views.flatMap((v) => v.channels.map((c) => c.key)));
  for (const c of store.channels) {
    if (!listed.has(c.key)) continue;
    const f = c.units[page.unit][1], at = [a, b].map((row) => (row === null ? NaN : store.at(c.key, row) * f));
    let mean = NaN, rms = NaN;
    if (a !== null && b !== null && a !== b) {
      const part = store.part(c.key, Math.min(a, b), Math.max(a, b), f);
      mean = part.reduce((s, v) => s + v, 0) / part.length;
      rms = Math.sqrt(part.reduce((s, v) => s + v * v, 0) / part.length);
    }
    rows.push([`${c.label} ${c.units[page.unit][0]}`, short(at[0]), short(at[1]), short(at[1] - at[0]), short(mean), short(rms)]);
  }
  $('cursors').replaceChildren(...rows.map((row, n) => {
    const line = document.createElement('tr');
    line.append(...row.map((text, m) => Object.assign(document.createElement(n && m ? 'td' : 'th'), { textContent: text })));
    return line;
  }));
}

// ---- presets, exports, views ----

function layout(shown) {
  for (const box of $('choices').querySelectorAll('input')) box.checked = shown.includes(box.value);
  $('panels').replaceChildren();
  page.views.forEach((view) => view.plot?.destroy());
  page.views = viewsOf(page.hello).filter((v) => shown.includes(v.name)).map((v) => new View(v.name, page, $('panels')));
  page.dirty = true;
}

function presets(found) {
  page.presets = found;
  $('presets').replaceChildren(...Object.keys(found).sort().map((name) => new Option(name, name)));
}
const taking = () => ({
  views: page.views.map((v) => v.name), span: page.span, unit: page.unit,
  trigger: Object.fromEntries(['source', 'edge', 'level', 'before', 'mode'].map((id) => [id, $(id).value])),
});
function recall(kept) {
  if (!kept) return;
  for (const [id, value] of Object.entries(kept.trigger || {})) if ($(id)) $(id).value = value;
  $('span').value = page.span = kept.span || 1000;
  units(kept.unit || 0);
  layout(kept.views || []);
  arm($('mode').value);
  page.follow();
}

function units(n) {
  page.unit = n;
  $('units').value = n;
  document.activeElement?.blur?.();
  settings(page.settings);
  page.dirty = true;
}

function png() {
  const canvases = page.views.map((v) => [v, v.plot.ctx.canvas]), width = Math.max(...canvases.map(([, c]) => c.width));
  const out = document.createElement('canvas'), gap = 24;
  out.width = width;
  out.height = canvases.reduce((sum, [, c]) => sum + c.height + gap, 0);
  const ctx = out.getContext('2d');
  ctx.fillStyle = getComputedStyle(document.body).backgroundColor;
  ctx.fillRect(0, 0, out.width, out.height);
  let top = 0;
  for (const [view, canvas] of canvases) {
    ctx.fillStyle = getComputedStyle(document.body).color;
    ctx.font = '14px sans-serif';
    ctx.fillText(`${view.element.querySelector('h2 span').textContent} · ${view.note.textContent}`, 6, top + 17);
    ctx.drawImage(canvas, 0, top + gap);
    top += canvas.height + gap;
  }
  out.toBlob((blob) => {
    const link = Object.assign(document.createElement('a'), { href: URL.createObjectURL(blob), download: 'scope.png' });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
}

function begin(hello) {
  const again = page.hello !== null;
  page.hello = hello;
  document.title = `scope · ${hello.title}`;
  recordings.clear();
  page.store = page.own = new Store(hello.channels, hello.ts, KEPT);
  page.marks = { a: null, b: null, t: null };
  $('drive').hidden = !hello.live;
  $('settings').hidden = !hello.live;
  $('record').hidden = !hello.recorder;
  presets(hello.presets);
  settings(hello.settings);
  const usual = viewsOf(hello);
  if (!again) {
    $('choices').replaceChildren(...usual.map((v) => {
      const label = document.createElement('label');
      const box = Object.assign(document.createElement('input'), { type: 'checkbox', value: v.name, checked: v.shown });
      box.onchange = () => layout([...$('choices').querySelectorAll('input:checked')].map((b) => b.value));
      label.append(box, ` ${v.title}`);
      return label;
    }));
    $('source').replaceChildren(...['fault', 'deadlock', 'saturated'].filter((n) => n === 'fault' || hello.channels.some((c) => c.key === n)).map((n) => new Option(n, n)), ...hello.channels.filter((c) => !/_(low|high)$/.test(c.key)).map((c) => new Option(c.label, c.key)));
  }
  layout(again ? page.views.map((v) => v.name) : usual.filter((v) => v.shown).map((v) => v.name));
  page.known = null;
  page.ready = true;
  arm('off');
  page.follow();
  if (!again && hello.live && location.hash === '#start') order('start');
}

$('start').onclick = () => { page.follow(); order('start'); };
$('stop').onclick = () => order('stop');
$('clear').onclick = () => order('clear');
$('trip').onclick = () => order('trip');
$('record').onclick = () => order('record');
$('hold').onclick = () => (page.view.follows ? page.zoom(page.window().from, page.window().until) : page.follow());
$('whole').onclick = () => page.zoom(page.store.first, Math.max(page.store.total, page.store.first + 10));
$('narrower').onclick = () => page.scale(0.5);
$('wider').onclick = () => page.scale(2);
$('span').onchange = () => { page.span = Math.max(20, Math.min(KEPT, +$('span').value || 1000)); page.follow(); };
$('units').onchange = () => units(+$('units').value);
$('mode').onchange = () => arm($('mode').value);
$('arm').onclick = () => arm('single');
$('png').onclick = png;
$('keep').onclick = () => { const name = $('name').value.trim(); if (name) order('preset', { name, value: taking() }); else say('a preset needs a name'); };
$('recall').onclick = () => recall(page.presets[$('presets').value]);
$('forget').onclick = () => order('preset', { name: $('presets').value, value: null });
for (const link of document.querySelectorAll('#export a')) {
  link.onclick = () => {
    const { from, until } = page.window();
    link.href = `export/${link.dataset.kind}?first=${Math.max(from, page.store.first)}&last=${Math.min(until, page.store.total)}&unit=${page.unit}&recording=${page.store.recording || ''}`;
  };
}
document.addEventListener('keydown', (e) => {
  if (!page.store || /INPUT|SELECT|TEXTAREA/.test(e.target.tagName) || e.ctrlKey || e.altKey || e.metaKey) return;
  const { from, until } = page.window(), move = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
  if (move) { const name = e.shiftKey ? 'b' : 'a'; page.place(name, (page.marks[name] ?? Math.round((from + until) / 2)) + move); }
  else if (e.key === ' ' && e.target.tagName !== 'BUTTON' && e.target.tagName !== 'SUMMARY') $('hold').click();
  else if (e.key === '+') page.scale(0.5);
  else if (e.key === '-') page.scale(2);
  else if (e.key === '0') $('whole').click();
  else if (e.key === 'Escape') order('stop');
  else return;
  e.preventDefault();
});
let pressed = 0;
document.addEventListener('mousedown', (e) => { pressed = e.clientX; page.dragged = false; }, true);
document.addEventListener('mouseup', (e) => { page.dragged = Math.abs(e.clientX - pressed) > 4; }, true);

connect();
requestAnimationFrame(frame);
