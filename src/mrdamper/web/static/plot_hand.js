// Mouse and keyboard on a plot: the shared cursor of linked plots, zoom, and choice of a point.
//
// Drag or Ctrl and wheel zoom, a double click shows everything; keys: arrows + - 0.

import { lowerBound } from "./decimate.js";
import { CanvasPen } from "./pens.js";
import { palette } from "./theme.js";

const CLICK_PX = 5;
const NEAR_PX = 18;
const MOST_SAID = 8;

/** Draw the overlay of a plot: the cursor (a time `t`, or the `hit` under the pointer), or an unfinished selection. */
export function drawOver(plot, cursor, selection = null) {
  const { frame, over } = plot;
  if (!frame || (!cursor && !selection && plot.clear)) return;
  const context = over.getContext("2d");
  const scale = window.devicePixelRatio || 1;
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, over.width, over.height);
  plot.clear = !cursor && !selection;
  const colours = palette();
  const { left, top, width, height } = frame.inner;
  const pen = new CanvasPen(context);
  if (selection) {
    const [x0, x1] = [selection.x0, selection.x1].sort((a, b) => a - b);
    const [y0, y1] = selection.flat ? [top, top + height] : [selection.y0, selection.y1].sort((a, b) => a - b);
    pen.rect(x0, y0, x1 - x0, y1 - y0, colours.brush);
  }
  const said = cursor && !selection ? drawCursor(plot, pen, cursor, colours) : [];
  plot.readout.textContent = said.slice(0, MOST_SAID).join("  ·  ");
}

/** Draw the cursor; return its text. */
function drawCursor(plot, pen, { t, hit }, colours) {
  const { frame } = plot;
  const { left, top, width, height } = frame.inner;
  const [xName, xUnit] = parted(plot.options.x);
  const [, yUnit] = parted(plot.options.y);
  const said = [];
  const shown = plot.drawn.filter(({ one }) => t !== null && (one.kind === "series" || one.t));
  pen.clip(left, top, width, height);
  if (shown.some(({ one }) => one.kind === "series")) {
    const x = frame.toX(t);
    pen.line([x, top, x, top + height], { colour: colours.soft, width: 0.8, dash: [3, 3] });
    said.push(`${xName} ${precise(t, frame.x)} ${xUnit}`);
  }
  for (const { one } of shown) {
    const at = nearest(one.t ?? one.x, t);
    if (at < 0) continue;
    pen.marks([frame.toX(one.x[at]), frame.toY(one.y[at])], { colour: one.colour(colours), radius: 3 });
    if (one.kind === "series") said.push(`${one.name} ${precise(one.y[at], frame.y)} ${yUnit}`);
    else said.push(`${one.name}: ${precise(one.x[at], frame.x)} ${xUnit}, ${precise(one.y[at], frame.y)} ${yUnit}`);
  }
  if (hit && !shown.length) {
    pen.line([left, hit.y, left + width, hit.y], { colour: colours.soft, width: 0.8, dash: [3, 3] });
    pen.line([hit.x, top, hit.x, top + height], { colour: colours.soft, width: 0.8, dash: [3, 3] });
    pen.marks([hit.x, hit.y], { colour: hit.one.colour(colours), radius: 3.5 });
    const more = hit.one.words ? ` · ${hit.one.words(hit.index)}` : "";
    said.push(`${hit.one.name}: ${xName} ${precise(hit.one.x[hit.index], frame.x)} ${xUnit} · ${precise(hit.one.y[hit.index], frame.y)} ${yUnit}${more}`);
  }
  pen.unclip();
  return said;
}

/** Return the drawn point nearest to the pointer, or null. */
function hitOf(plot, pointer, within) {
  let best = null;
  let least = within * within;
  for (const { one, pieces } of plot.drawn) {
    for (const { points, at } of pieces) {
      for (let k = 0; k < points.length; k += 2) {
        const gap = (points[k] - pointer.x) ** 2 + (points[k + 1] - pointer.y) ** 2;
        if (gap < least) {
          least = gap;
          best = { one, index: at ? at[k / 2] : k / 2, x: points[k], y: points[k + 1] };
        }
      }
    }
  }
  return best;
}

/** Move the cursor of this plot and of its linked plots to the pointer. */
function point(plot, pointer) {
  const { inner, x } = plot.frame ?? {};
  if (!inner || pointer.x < inner.left || pointer.x > inner.left + inner.width || pointer.y < inner.top || pointer.y > inner.top + inner.height) {
    leave(plot);
    return;
  }
  const timed = plot.drawn.some(({ one }) => one.kind === "series");
  const hit = timed ? null : hitOf(plot, pointer, Infinity);
  const t = timed ? unlinear(pointer.x, x, inner.left, inner.left + inner.width) : hit?.one.t?.[hit.index] ?? null;
  if (t === null) drawOver(plot, { t, hit });
  else plot.link.point(t, plot, hit);
}

const leave = (plot) => plot.link.members.forEach((one) => drawOver(one, null));

/** Add the listeners for mouse and keyboard to a plot. */
export function listen(plot) {
  const { over } = plot;
  let start = null;
  const place = (event) => {
    const box = over.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  over.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    start = place(event);
    over.setPointerCapture(event.pointerId);
  });
  over.addEventListener("pointermove", (event) => {
    const here = place(event);
    if (start && Math.hypot(here.x - start.x, here.y - start.y) > CLICK_PX) {
      const flat = plot.isFlat();
      drawOver(plot, null, { x0: start.x, y0: start.y, x1: here.x, y1: here.y, flat });
      if (flat) plot.options.onSelect?.(rangeOf(plot, start, here).x);
    } else point(plot, here);
  });
  over.addEventListener("pointerleave", () => leave(plot));
  over.addEventListener("pointercancel", () => {
    start = null;
    plot.options.onSelect?.(null);
    leave(plot);
  });
  over.addEventListener("pointerup", (event) => {
    if (!start) return;
    const [from, here] = [start, place(event)];
    start = null;
    if (Math.hypot(here.x - from.x, here.y - from.y) <= CLICK_PX) {
      const hit = plot.options.onPick && hitOf(plot, here, NEAR_PX);
      if (hit) plot.options.onPick(hit.one, hit.index);
      return;
    }
    const { x, y } = rangeOf(plot, from, here);
    plot.look(x, plot.isFlat() ? null : y);
  });
  over.addEventListener("dblclick", () => plot.whole());
  over.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey || !plot.frame) return;
      event.preventDefault();
      zoom(plot, event.deltaY > 0 ? 1.25 : 0.8, place(event).x);
    },
    { passive: false },
  );
  over.addEventListener("keydown", (event) => press(plot, event));
}

/** Return the ranges of x and y between two pointer positions. */
function rangeOf({ frame }, from, here) {
  const { inner, x, y } = frame;
  const keep = (value, low, high) => Math.min(high, Math.max(low, value));
  const inX = (px) => unlinear(keep(px, inner.left, inner.left + inner.width), x, inner.left, inner.left + inner.width);
  const inY = (py) => unlinear(keep(py, inner.top, inner.top + inner.height), y, inner.top + inner.height, inner.top);
  return { x: [inX(from.x), inX(here.x)].sort((a, b) => a - b), y: [inY(from.y), inY(here.y)].sort((a, b) => a - b) };
}

function zoom(plot, factor, atPixel = null) {
  const { inner, x, y } = plot.frame;
  const share = atPixel === null ? 0.5 : (atPixel - inner.left) / inner.width;
  const centre = x[0] + share * (x[1] - x[0]);
  const middle = (y[0] + y[1]) / 2;
  plot.look([centre + (x[0] - centre) * factor, centre + (x[1] - centre) * factor], plot.isFlat() ? null : y.map((value) => middle + (value - middle) * factor));
}

function press(plot, event) {
  if (!plot.frame || event.ctrlKey || event.metaKey) return;
  const { x } = plot.frame;
  const step = (x[1] - x[0]) * 0.1;
  const moves = { ArrowLeft: -step, ArrowRight: step };
  if (event.key in moves) plot.look(x.map((value) => value + moves[event.key]), plot.view?.y ?? null);
  else if (event.key === "+" || event.key === "=") zoom(plot, 0.8);
  else if (event.key === "-") zoom(plot, 1.25);
  else if (event.key === "0" || event.key === "Escape") plot.whole();
  else return;
  event.preventDefault();
}

// ---------------------------------------------------------------------------------------------- numbers

const unlinear = (pixel, [low, high], a, b) => low + ((pixel - a) / (b - a)) * (high - low);
const precise = (value, [low, high]) => {
  const decimals = Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(Math.max(high - low, 1e-12)))));
  return Number.isFinite(value) ? value.toFixed(decimals).replace("-", "−") : "–";
};
const parted = (label) => {
  const comma = label.lastIndexOf(", ");
  return comma < 0 ? [label, ""] : [label.slice(0, comma), label.slice(comma + 2)];
};
const nearest = (x, value) => {
  const at = lowerBound(x, value);
  if (at === 0) return x.length ? 0 : -1;
  if (at >= x.length) return x.length - 1;
  return value - x[at - 1] < x[at] - value ? at - 1 : at;
};
