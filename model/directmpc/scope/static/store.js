// What the page keeps: rings of samples and of gate edges, and what is computed of them.

export const KEPT = 32768;

// Rows by their numbers; the oldest are overwritten.
export class Store {
  constructor(channels, ts, capacity = KEPT) {
    this.channels = channels;
    this.ts = ts;
    this.capacity = capacity;
    this.total = 0;
    this.first = 0;
    this.rings = channels.map(() => new Float32Array(capacity));
    this.place = new Map(channels.map((c, n) => [c.key, n]));
    this.times = new Float64Array(2 * capacity);
    this.words = new Uint32Array(2 * capacity);
    this.edges = 0;
  }
  add(from, count, values) {
    if (from !== this.total) this.first = from; // the server has left rows out
    for (let c = 0; c < this.rings.length; c++) {
      const ring = this.rings[c];
      for (let k = 0; k < count; k++) ring[(from + k) % this.capacity] = values[c * count + k];
    }
    this.total = from + count;
    this.first = Math.max(this.first, this.total - this.capacity);
  }
  addEdges(times, words) {
    for (let k = 0; k < times.length; k++, this.edges++) {
      this.times[this.edges % this.times.length] = times[k];
      this.words[this.edges % this.words.length] = words[k];
    }
  }
  at(key, row) {
    const n = this.place.get(key);
    return n === undefined || row < this.first || row >= this.total ? NaN : this.rings[n][row % this.capacity];
  }
  // A channel's rows a to b - 1, times a factor.
  part(key, a, b, factor = 1) {
    const ring = this.rings[this.place.get(key)], out = new Float32Array(Math.max(0, b - a));
    for (let k = 0; k < out.length; k++) {
      const row = a + k;
      out[k] = row < this.first || row >= this.total ? NaN : ring[row % this.capacity] * factor;
    }
    return out;
  }
  // Edges from a time on until another, and the gates before them.
  edgesIn(from, until) {
    const size = this.times.length, oldest = Math.max(0, this.edges - size);
    let low = oldest, high = this.edges;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle % size] < from) low = middle + 1; else high = middle;
    }
    const found = [[from, low > oldest ? this.words[(low - 1) % size] : 0]];
    for (let k = low; k < this.edges && this.times[k % size] <= until; k++) found.push([this.times[k % size], this.words[k % size]]);
    return found;
  }
}

// Amplitudes of the frequencies of samples, Hann window, the largest power of two that fits.
export function spectrum(samples, ts) {
  let size = 1;
  while (size * 2 <= samples.length) size *= 2;
  if (size < 16) return [[], []];
  const re = new Float64Array(size), im = new Float64Array(size), begin = samples.length - size;
  let mean = 0;
  for (let k = 0; k < size; k++) mean += samples[begin + k] / size;
  for (let k = 0; k < size; k++) re[k] = (samples[begin + k] - mean) * (0.5 - 0.5 * Math.cos(2 * Math.PI * k / size));
  for (let i = 1, j = 0; i < size; i++) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]];
  }
  for (let length = 2; length <= size; length *= 2) {
    const angle = -2 * Math.PI / length;
    for (let k = 0; k < length / 2; k++) {
      const c = Math.cos(angle * k), s = Math.sin(angle * k);
      for (let i = k; i < size; i += length) {
        const j = i + length / 2, x = re[j] * c - im[j] * s, y = re[j] * s + im[j] * c;
        re[j] = re[i] - x; im[j] = im[i] - y; re[i] += x; im[i] += y;
      }
    }
  }
  const f = [], amplitude = [];
  for (let k = 0; k < size / 2; k++) { f.push(k / size / ts); amplitude.push(4 * Math.hypot(re[k], im[k]) / size); }
  return [f, amplitude];
}

// Ratio of what is left of samples without mean and fundamental to the fundamental, over whole periods; NaN below one.
export function thd(samples, omega, ts) {
  const period = 2 * Math.PI / Math.abs(omega * ts), periods = Math.floor((samples.length + 0.5) / period);
  if (!(periods >= 1)) return NaN;
  const count = Math.min(Math.round(periods * period), samples.length);
  // normal equations of cosine, sine and one
  const m = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]];
  for (let k = 0; k < count; k++) {
    const row = [Math.cos(omega * ts * k), Math.sin(omega * ts * k), 1, samples[k]];
    for (let i = 0; i < 3; i++) for (let j = 0; j < 4; j++) m[i][j] += row[i] * row[j];
  }
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) {
      if (i === j) continue;
      const share = m[j][i] / m[i][i];
      for (let n = i; n < 4; n++) m[j][n] -= share * m[i][n];
    }
  }
  const [a, b, mean] = m.map((row, i) => row[3] / row[i]);
  let rest = 0;
  for (let k = 0; k < count; k++) rest += (samples[k] - mean - a * Math.cos(omega * ts * k) - b * Math.sin(omega * ts * k)) ** 2;
  return Math.sqrt(rest / count) / (Math.hypot(a, b) / Math.SQRT2);
}

// Angular frequency of the current vector over rows a to b - 1, rad/s.
export function turning(store, a, b) {
  let angle = 0, before = null;
  for (let k = Math.max(a, store.first); k < Math.min(b, store.total); k++) {
    const x = store.at('i_a', k), y = (store.at('i_b', k) - store.at('i_c', k)) / Math.sqrt(3), now = Math.atan2(y, x);
    if (before !== null) angle += Math.atan2(Math.sin(now - before), Math.cos(now - before));
    before = now;
  }
  return angle / ((b - a - 1) * store.ts);
}
