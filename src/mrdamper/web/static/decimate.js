// Fewer points that look the same: what a plot draws of series with millions of samples.
//
// Pure functions on typed arrays, pixels in and pixels out. A time series keeps the first, lowest, highest and
// last sample of every pixel column; a loop keeps the segments that touch a pixel nobody has touched yet. Nothing
// is drawn here.

/** Return the first index in sorted `x` whose value is not below `value`. */
export function lowerBound(x, value) {
  let low = 0;
  let high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Tell whether `x` never falls (NaN counts as falling). */
export function isSorted(x) {
  for (let k = 1; k < x.length; k += 1) if (!(x[k] >= x[k - 1])) return false;
  return true;
}

/** Return the lowest and highest finite value from `from` up to `to`, or null when there is none. */
export function extent(values, from = 0, to = values.length) {
  let low = Infinity;
  let high = -Infinity;
  for (let k = from; k < to; k += 1) {
    const value = values[k];
    if (value < low) low = value;
    if (value > high && value < Infinity) high = value;
  }
  return low <= high && low > -Infinity ? [low, high] : null;
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
 * @param {number} columns width in pixels: with fewer than four samples in each, all are kept
 */
export function seriesPath(x, y, from, to, toX, toY, columns) {
  const out = [];
  if (to - from <= 4 * columns) {
    for (let k = from; k < to; k += 1) out.push(toX(x[k]), toY(y[k]));
    return Float64Array.from(out);
  }
  let column = NaN;
  let first = NaN;
  let low = Infinity;
  let high = -Infinity;
  let last = NaN;
  let lowAt = 0;
  let highAt = 0;
  const flush = () => {
    if (Number.isNaN(first)) {
      if (!Number.isNaN(column)) out.push(NaN, NaN);
      return;
    }
    const at = column + 0.5;
    out.push(at, toY(first));
    if (lowAt <= highAt) out.push(at, toY(low), at, toY(high));
    else out.push(at, toY(high), at, toY(low));
    out.push(at, toY(last));
  };
  for (let k = from; k < to; k += 1) {
    const here = Math.floor(toX(x[k]));
    if (here !== column) {
      flush();
      column = here;
      first = NaN;
      low = Infinity;
      high = -Infinity;
    }
    const value = y[k];
    if (value === value) {
      if (first !== first) first = value;
      if (value < low) {
        low = value;
        lowAt = k;
      }
      if (value > high) {
        high = value;
        highAt = k;
      }
      last = value;
    }
  }
  flush();
  return Float64Array.from(out);
}

/**
 * Return pixels of a loop: only segments that touch a pixel which no earlier segment touched.
 *
 * @param {ArrayLike<number>} x
 * @param {ArrayLike<number>} y of the same length
 * @param {(v: number) => number} toX value to pixel
 * @param {(v: number) => number} toY value to pixel
 * @param {number} width of the drawing in pixels
 * @param {number} height of the drawing in pixels
 * @param {number} [few] up to this many samples all are kept
 */
export function loopPath(x, y, toX, toY, width, height, few = 20000) {
  const out = [];
  const count = x.length;
  if (count <= few) {
    for (let k = 0; k < count; k += 1) out.push(toX(x[k]), toY(y[k]));
    return Float64Array.from(out);
  }
  const across = Math.ceil(width) + 1;
  const down = Math.ceil(height) + 1;
  const seen = new Uint8Array(across * down);
  const touch = (px, py) => {
    if (px < 0 || py < 0 || px >= across || py >= down) return false;
    const at = py * across + px;
    if (seen[at] === 1) return false;
    seen[at] = 1;
    return true;
  };
  let x0 = toX(x[0]);
  let y0 = toY(y[0]);
  let open = false;
  for (let k = 1; k < count; k += 1) {
    const x1 = toX(x[k]);
    const y1 = toY(y[k]);
    const broken = !(x0 === x0 && y0 === y0 && x1 === x1 && y1 === y1);
    let fresh = false;
    if (!broken) {
      const steps = Math.max(1, Math.ceil(Math.max(Math.abs(x1 - x0), Math.abs(y1 - y0))));
      if (steps > 4 * across) fresh = true;
      else {
        for (let s = 0; s <= steps; s += 1) {
          const px = (x0 + ((x1 - x0) * s) / steps) | 0;
          const py = (y0 + ((y1 - y0) * s) / steps) | 0;
          if (touch(px, py)) fresh = true;
        }
      }
    }
    if (fresh) {
      if (!open) out.push(NaN, NaN, x0, y0);
      out.push(x1, y1);
    }
    open = fresh;
    x0 = x1;
    y0 = y1;
  }
  return Float64Array.from(out);
}

/** Return about `wanted` round numbers between two values, and how many decimals they need. */
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
