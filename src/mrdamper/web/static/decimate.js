// Decimation of series with millions of samples to points that give the same picture.
//
// A time series keeps the first, lowest, highest and last sample of every pixel column. The extremes of blocks of
// samples speed up the search. A loop keeps the segments that touch a new pixel. Nothing is drawn here.

/** Return the first index in sorted `x` from `low` to `high` whose value is at least `value`. */
export function lowerBound(x, value, low = 0, high = x.length) {
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

const BLOCK = 256; // Samples of a block.
const blocks = new WeakMap();
const sorted = new WeakMap();

/** Return true if `x` never decreases; NaN counts as a decrease. */
export function isSorted(x) {
  if (sorted.has(x)) return sorted.get(x);
  let rises = true;
  for (let k = 1; k < x.length && rises; k += 1) rises = x[k] >= x[k - 1];
  if (ArrayBuffer.isView(x)) sorted.set(x, rises);
  return rises;
}

function scan(values, from, to, ends) {
  for (let k = from; k < to; k += 1) {
    const value = values[k];
    if (value < ends[0] && value > -Infinity) ends[0] = value;
    if (value > ends[1] && value < Infinity) ends[1] = value;
  }
}

/** Return the lowest and highest value of every block of a typed array; the result is cached. */
function blocksOf(values) {
  let found = blocks.get(values);
  if (!found) {
    const count = Math.ceil(values.length / BLOCK);
    found = new Float64Array(2 * count);
    for (let b = 0; b < count; b += 1) {
      const ends = [Infinity, -Infinity];
      scan(values, b * BLOCK, Math.min((b + 1) * BLOCK, values.length), ends);
      found.set(ends, 2 * b);
    }
    blocks.set(values, found);
  }
  return found;
}

/** Return the lowest and highest finite value from `from` to `to`; null if there is no finite value. */
export function extent(values, from = 0, to = values.length) {
  const ends = [Infinity, -Infinity];
  const first = Math.ceil(from / BLOCK);
  const last = Math.floor(to / BLOCK);
  if (last - first < 2 || !ArrayBuffer.isView(values)) scan(values, from, to, ends);
  else {
    const found = blocksOf(values);
    scan(values, from, first * BLOCK, ends);
    for (let b = first; b < last; b += 1) {
      if (found[2 * b] < ends[0]) ends[0] = found[2 * b];
      if (found[2 * b + 1] > ends[1]) ends[1] = found[2 * b + 1];
    }
    scan(values, last * BLOCK, to, ends);
  }
  return ends[0] <= ends[1] ? ends : null;
}

/**
 * Return pixels of a time series between two indices: `[x0, y0, x1, y1, ...]`, NaN where the line breaks.
 *
 * @param {ArrayLike<number>} x sorted
 * @param {ArrayLike<number>} y of the same length
 * @param {number} from first index
 * @param {number} to one past the last index
 * @param {(v: number) => number} toX value to pixel
 * @param {(v: number) => number} toY value to pixel
 * @param {number} columns width in pixels; with fewer than four samples per column all samples are kept
 */
export function seriesPath(x, y, from, to, toX, toY, columns) {
  const out = [];
  if (to - from <= 4 * columns) {
    for (let k = from; k < to; k += 1) out.push(toX(x[k]), toY(y[k]));
    return Float64Array.from(out);
  }
  const left = Math.floor(toX(x[from]));
  const perPixel = (x[to - 1] - x[from]) / (toX(x[to - 1]) - toX(x[from]));
  const origin = x[from] + (left - toX(x[from])) * perPixel;
  for (let k = from, column = left; k < to; column += 1) {
    const end = column > left + 2 * columns ? to : lowerBound(x, origin + (column + 1 - left) * perPixel, k, to);
    if (end === k) continue;
    const at = column + 0.5;
    const ends = extent(y, k, end);
    if (ends) {
      const [first, last] = [y[k], y[end - 1]];
      if (first === first) out.push(at, toY(first));
      out.push(at, toY(ends[0]), at, toY(ends[1]));
      if (last === last) out.push(at, toY(last));
    } else out.push(NaN, NaN);
    k = end;
  }
  return Float64Array.from(out);
}

const PIECE = 4096; // Samples of one piece.
const FEW = 20000; // Up to this number all samples are kept.

/**
 * Yield the pieces of a loop: `{points, at}`, pixels in the format of `seriesPath` and the sample of each.
 *
 * A long loop keeps only segments that touch a new pixel. The pieces are spread over the loop, so that the first pieces
 * show the shape of the loop.
 *
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y of the same length
 * @param {number} from first index
 * @param {number} to one past the last index
 * @param {(v: number) => number} toX value to pixel
 * @param {(v: number) => number} toY value to pixel
 * @param {number} width of the drawing in pixels
 * @param {number} height of the drawing in pixels
 */
export function* loopPieces(x, y, from, to, toX, toY, width, height) {
  const pieces = Math.ceil((to - from) / PIECE);
  const all = to - from <= FEW;
  const across = Math.ceil(width) + 1;
  const down = Math.ceil(height) + 1;
  const seen = all ? null : new Uint8Array(across * down);
  const touched = (x0, y0, x1, y1) => {
    const steps = Math.max(1, Math.ceil(Math.max(Math.abs(x1 - x0), Math.abs(y1 - y0))));
    if (steps > 4 * across) return true;
    let fresh = false;
    for (let s = 0; s <= steps; s += 1) {
      const px = (x0 + ((x1 - x0) * s) / steps) | 0;
      const py = (y0 + ((y1 - y0) * s) / steps) | 0;
      if (px < 0 || py < 0 || px >= across || py >= down || seen[py * across + px] === 1) continue;
      seen[py * across + px] = 1;
      fresh = true;
    }
    return fresh;
  };
  for (const piece of all ? Array(pieces).keys() : scattered(pieces)) {
    const begin = from + piece * PIECE;
    const end = Math.min(to, begin + PIECE + 1); // The last sample of a piece is the first of the next.
    const points = [];
    const at = [];
    const keep = (k, px, py) => {
      points.push(px, py);
      at.push(k);
    };
    let x0 = toX(x[begin]);
    let y0 = toY(y[begin]);
    let open = all;
    if (all) keep(begin, x0, y0);
    for (let k = begin + 1; k < end; k += 1) {
      const x1 = toX(x[k]);
      const y1 = toY(y[k]);
      const known = x0 === x0 && y0 === y0 && x1 === x1 && y1 === y1;
      const fresh = all || (known && touched(x0, y0, x1, y1));
      if (fresh) {
        if (!open) {
          keep(k - 1, NaN, NaN);
          keep(k - 1, x0, y0);
        }
        keep(k, x1, y1);
      }
      open = fresh;
      x0 = x1;
      y0 = y1;
    }
    if (points.length) yield { points: Float64Array.from(points), at: Uint32Array.from(at) };
  }
}

/** Yield 0 to count - 1 in a spread order. */
function* scattered(count) {
  let step = Math.max(1, Math.round(0.618 * count));
  const common = (a, b) => (b ? common(b, a % b) : a);
  while (common(step, count) !== 1) step += 1;
  for (let k = 0, at = 0; k < count; k += 1, at = (at + step) % count) yield at;
}

/** Return about `wanted` round numbers between two values, and the number of decimals. */
export function ticks(low, high, wanted) {
  const span = high - low;
  if (!(span > 0)) return { values: [low], decimals: 0 };
  const rough = span / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const away = (factor) => Math.abs(Math.log(factor / (rough / power)));
  const factor = [1, 2, 2.5, 5, 10].reduce((best, each) => (away(each) < away(best) ? each : best));
  const step = factor * power;
  const decimals = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (factor === 2.5 ? 1 : 0)));
  const values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) values.push(k * step);
  return { values, decimals };
}
