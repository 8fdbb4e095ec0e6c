// The views: each one a uPlot, all with the same rows, the same zoom and the same cursors.
import { spectrum, thd, turning } from './store.js';

const COLOURS = ['#d62728', '#1f77b4', '#2ca02c', '#9467bd', '#ff7f0e', '#17becf', '#8c564b', '#e377c2'];
const TITLES = {
  currents: 'Currents and bounds', capacitors: 'Phase capacitors', neutral: 'Neutral point', link: 'dc link', torque: 'Torque', flux: 'Flux',
  speed: 'Speed', levels: 'Levels', positions: 'Positions', gates: 'Gates', costs: 'Costs', lengths: 'Lengths', flags: 'Flags', clocks: 'Clocks of a decision',
  faults: 'Faults', histogram: 'Histogram of clocks', spectrum: 'Spectrum', xy: 'XY',
};
const HIDDEN = new Set(['link', 'flags', 'clocks', 'faults']);

// Names of the views of a drive, and which of them are shown at first.
export function viewsOf(hello) {
  const groups = [...new Set(hello.channels.map((c) => c.group))];
  const names = [...groups, 'gates', 'histogram', 'spectrum', 'xy'];
  return names.map((name) => ({ name, title: TITLES[name] || name, shown: !HIDDEN.has(name) }));
}

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class View {
  constructor(name, page, parent) {
    this.name = name;
    this.page = page;
    this.element = document.createElement('article');
    this.element.className = 'panel';
    this.element.id = `view-${name}`;
    const head = document.createElement('h2');
    head.innerHTML = `<span>${TITLES[name] || name}</span><small></small>`;
    this.note = head.lastChild;
    this.box = document.createElement('div');
    this.element.append(head, this.box);
    parent.append(this.element);
    this.visible = true;
    new IntersectionObserver((seen) => { this.visible = seen[0].isIntersecting; page.dirty = true; }, { rootMargin: '100px' }).observe(this.element);
    new ResizeObserver(() => this.fit()).observe(this.element);
    if (name === 'spectrum' || name === 'xy') this.choices(head);
    this.build();
  }
  choices(head) {
    const asked = this.name === 'xy' ? ['x', 'y'] : ['of'];
    this.picked = this.name === 'xy' ? { x: 'i_a', y: 'i_b' } : { of: 'i_a' };
    for (const what of asked) {
      const select = document.createElement('select');
      select.setAttribute('aria-label', `${this.name} ${what}`);
      for (const c of this.page.store.channels) select.add(new Option(c.label, c.key, false, c.key === this.picked[what]));
      select.onchange = () => { this.picked[what] = select.value; this.page.dirty = true; };
      head.insertBefore(select, this.note);
    }
  }
  get channels() { return this.page.store.channels.filter((c) => c.group === this.name); }
  build() {
    this.plot?.destroy();
    const { page } = this, store = page.store, time = { stroke: css('--fore'), grid: { stroke: css('--line') }, size: 30, values: (_, splits, axis, space, step) => splits.map((s) => s.toFixed(Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)))) };
    const y = { stroke: css('--fore'), grid: { stroke: css('--line') }, size: 56 };
    const base = { width: Math.max(200, this.element.clientWidth - 6), height: 190, legend: { show: false }, scales: { x: { time: false } }, axes: [time, y] };
    const cursor = { sync: { key: 'scope' }, drag: { x: true, y: false, setScale: false } };
    if (this.name === 'histogram') {
      this.plot = new uPlot({ ...base, cursor: { drag: { x: false, y: false } }, series: [{}, { fill: '#1f77b488', stroke: COLOURS[1], paths: uPlot.paths.bars({ size: [1, 60] }), points: { show: false } }] }, [[0], [0]], this.box);
    } else if (this.name === 'spectrum') {
      this.plot = new uPlot({ ...base, cursor: { drag: { x: true, y: false } }, series: [{}, { stroke: COLOURS[0], points: { show: false } }] }, [[0], [0]], this.box);
    } else if (this.name === 'xy') {
      const draw = (u) => this.drawXy(u);
      this.plot = new uPlot({ ...base, height: 240, cursor: { show: false }, series: [{}, { paths: () => null, points: { show: false } }], hooks: { draw: [draw] } }, [[0], [0]], this.box);
    } else {
      const marks = (u) => this.drawMarks(u);
      const hooks = {
        draw: [...(this.name === 'gates' ? [(u) => this.drawGates(u)] : []), marks],
        setSelect: [(u) => { if (u.select.width > 4) page.zoom(u.posToVal(u.select.left, 'x') / store.ts, u.posToVal(u.select.left + u.select.width, 'x') / store.ts); u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false); }],
        ready: [(u) => {
          u.over.addEventListener('click', (e) => { if (!page.dragged) page.place(e.shiftKey ? 'b' : 'a', u.posToVal(e.offsetX, 'x') / store.ts); });
          u.over.addEventListener('wheel', (e) => { e.preventDefault(); page.scale(e.deltaY > 0 ? 1.25 : 0.8, u.posToVal(e.offsetX, 'x') / store.ts); }, { passive: false });
        }],
      };
      if (this.name === 'gates') {
        const lanes = page.hello.gates, height = 60 + lanes * 10;
        const axes = [base.axes[0], { ...y, splits: () => Array.from({ length: lanes }, (_, n) => lanes - n - 0.5), values: (_, splits) => splits.map((s) => page.gateName(Math.round(lanes - s - 0.5))), space: 8, font: '9px sans-serif', grid: { show: false } }];
        this.plot = new uPlot({ ...base, height, cursor, axes, scales: { x: { time: false }, y: { range: [0, lanes] } }, series: [{}, { paths: () => null, points: { show: false } }], hooks }, [[0, 1], [0, 0]], this.box);
      } else {
        let n = 0;
        const bounds = new Set(this.channels.flatMap((c) => [c.low, c.high]).filter(Boolean));
        const own = new Map();
        for (const c of this.channels) if (!bounds.has(c.key)) own.set(c.key, COLOURS[n++ % COLOURS.length]);
        const colour = (c) => own.get(c.key) || own.get(this.channels.find((d) => d.low === c.key || d.high === c.key)?.key);
        const series = this.channels.map((c) => ({
          label: c.label, stroke: bounds.has(c.key) ? colour(c) + '66' : colour(c), width: bounds.has(c.key) ? 0.7 : 1.3, points: { show: false },
          ...(c.style === 'step' ? { paths: uPlot.paths.stepped({ align: 1 }) } : {}),
        }));
        const place = (key) => this.channels.findIndex((c) => c.key === key) + 1;
        const seen = new Set(), bands = [];
        for (const c of this.channels) {
          if (!c.low || seen.has(c.low) || !place(c.low)) continue;
          seen.add(c.low);
          bands.push({ series: [place(c.high), place(c.low)], fill: colour(c) + '18' });
        }
        this.plot = new uPlot({ ...base, cursor, legend: { show: true, live: false }, series: [{}, ...series], bands, hooks }, [[0, 1], ...this.channels.map(() => [null, null])], this.box);
      }
    }
    this.page.dirty = true;
  }
  fit() {
    const width = Math.max(200, this.element.clientWidth - 6);
    if (this.plot && Math.abs(width - this.plot.width) > 2) this.plot.setSize({ width, height: this.plot.height });
  }
  draw(a, b, xs) {
    if (!this.visible) return;
    const { page } = this, store = page.store, unit = page.unit;
    if (this.name === 'histogram') {
      const counts = new Map();
      for (const c of store.part('cycles', a, b)) if (c > 0) counts.set(c, (counts.get(c) || 0) + 1);
      const sorted = [...counts.keys()].sort((x, y) => x - y);
      this.plot.setData([sorted.length ? sorted : [0], sorted.length ? sorted.map((c) => counts.get(c)) : [0]]);
      this.note.textContent = sorted.length ? `${sorted[0]} to ${sorted.at(-1)}` : 'no clocks known';
    } else if (this.name === 'spectrum') {
      const channel = page.channel(this.picked.of), samples = store.part(channel.key, Math.max(a, store.first), Math.min(b, store.total), channel.units[unit][1]);
      const [f, amplitude] = spectrum(samples, store.ts);
      this.plot.setData([f.length ? f : [0], amplitude.length ? amplitude : [0]]);
      const ratio = thd(samples, turning(store, a, b), store.ts);
      page.thd = ratio;
      this.note.textContent = `${channel.units[unit][0]} over Hz · THD ${Number.isFinite(ratio) ? (100 * ratio).toFixed(2) + ' %' : 'needs a period'}`;
    } else if (this.name === 'xy') {
      const [x, y] = ['x', 'y'].map((w) => { const c = page.channel(this.picked[w]); return store.part(c.key, a, b, c.units[unit][1]); });
      this.points = [x, y];
      const range = (v) => { let low = Infinity, high = -Infinity; for (const s of v) { if (s < low) low = s; if (s > high) high = s; } return low < high ? [low, high] : [low - 1 || -1, low + 1 || 1]; };
      const [x0, x1] = range(x), [y0, y1] = range(y);
      this.plot.setData([[x0, x1], [y0, y1]]);
    } else if (this.name === 'gates') {
      this.plot.setData([[xs[0], xs[xs.length - 1]], [0, 0]], false);
      this.plot.setScale('x', { min: xs[0], max: xs[xs.length - 1] });
      this.note.textContent = `dead time ${page.deadTime(xs[0], xs[xs.length - 1])}`;
    } else {
      this.plot.setData([xs, ...this.channels.map((c) => store.part(c.key, a, b, c.units[unit][1]))]);
      this.note.textContent = this.channels[0].units[unit][0] + (this.name === 'faults' ? page.faultNames(b) : '');
    }
  }
  drawXy(u) {
    if (!this.points) return;
    const { ctx } = u;
    ctx.save();
    ctx.strokeStyle = COLOURS[1];
    ctx.beginPath();
    this.points[0].forEach((x, k) => { const px = u.valToPos(x, 'x', true), py = u.valToPos(this.points[1][k], 'y', true); if (k) ctx.lineTo(px, py); else ctx.moveTo(px, py); });
    ctx.stroke();
    ctx.restore();
  }
  drawGates(u) {
    const { ctx } = u, from = u.scales.x.min, until = u.scales.x.max, lanes = this.page.hello.gates;
    const edges = this.page.store.edgesIn(from, until), end = Math.min(until, this.page.store.total * this.page.store.ts);
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    const height = u.bbox.height / lanes;
    for (let n = 0; n < lanes; n++) {
      ctx.fillStyle = COLOURS[Math.floor(n / (lanes / 3))];
      const top = u.bbox.top + n * height + height * 0.15;
      let on = null;
      const until_ = (time) => { if (on !== null) { const x = u.valToPos(on, 'x', true); ctx.fillRect(x, top, Math.max(0.5, u.valToPos(time, 'x', true) - x), height * 0.7); on = null; } };
      for (const [time, word] of edges) { if (word >>> n & 1) { if (on === null) on = time; } else until_(time); }
      until_(end);
    }
    ctx.restore();
  }
  drawMarks(u) {
    for (const [name, colour] of [['a', '#f59e0b'], ['b', '#10b981'], ['t', '#ef4444']]) {
      const row = this.page.marks[name];
      if (row === null) continue;
      const x = u.valToPos(row * this.page.store.ts, 'x', true);
      if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) continue;
      const { ctx } = u;
      ctx.save();
      ctx.strokeStyle = colour;
      ctx.setLineDash(name === 't' ? [] : [4, 4]);
      ctx.beginPath(); ctx.moveTo(x, u.bbox.top); ctx.lineTo(x, u.bbox.top + u.bbox.height); ctx.stroke();
      ctx.restore();
    }
  }
}
