// Plot: time series, loops or points on a canvas, with axes, units, legend, zoom, cursor and saving.
//
// A series is `{name, x, y, t, colour, kind, width, dash, radius, hollow, key, quiet, since}`. Series with the same `key`
// share one entry of the legend, which hides them together; `quiet` series have no entry. `colour` is a function of the
// palette. `kind` is `series` (x sorted), `loop` or `points`. `t` are the times of the samples of a loop. The y axis ignores
// samples before `since`. A plot also has `areas` (between two curves), `spans` (vertical stripes) and `rules` (straight
// lines). Saved pictures have the light colours. `plot_hand.js` handles mouse and keyboard.

import { extent, isSorted, loopPieces, lowerBound, seriesPath, ticks } from "./decimate.js";
import { button, el, fill } from "./dom.js";
import { CanvasPen } from "./pens.js";
import { saveCsv, savePng, saveSvg, svgOf } from "./plot_files.js";
import { drawOver, listen } from "./plot_hand.js";
import { onTheme, palette } from "./theme.js";

const SMALL = 11.5;
const MANY = 40000; // Loops with more samples are drawn in pieces.
const SLICE_MS = 6; // Drawing time before the browser can handle events.

const due = new Set(); // Plots to be drawn.

/** Draw one waiting plot; the others follow in the next frames. */
function drawDue() {
  for (const plot of due) {
    due.delete(plot);
    if (plot.paint()) plot.node.removeAttribute("data-drawing");
    else due.add(plot);
    if (plot.box.clientWidth) break; // Invisible plots cost no time.
  }
  if (due.size) requestAnimationFrame(drawDue);
}

/** Shared state of plots: hidden series, cursor, and the range of equal x axes. */
export class Link {
  constructor() {
    this.members = new Set();
    this.hidden = new Set();
  }

  /** Return the plots with the same x axis. */
  alike(plot) {
    return [...this.members].filter((one) => one.options.x === plot.options.x);
  }

  toggle(key) {
    if (!this.hidden.delete(key)) this.hidden.add(key);
    for (const plot of this.members) plot.set(plot, { keepView: true });
    this.onToggle?.();
  }

  /** Move the cursor of all plots to a time; the pointer is in plot `from` at `hit`. */
  point(t, from, hit = null) {
    for (const plot of this.members) drawOver(plot, { t, hit: plot === from ? hit : null });
  }
}

/** Return the function of the k-th colour of a palette. */
export const nth = (k) => (colours) => colours.colours[k % colours.colours.length];

export class Plot {
  /**
   * @param {object} options
   * @param {string} options.title title above the plot
   * @param {string} options.x label of the axis with its unit, such as "time, s"
   * @param {string} options.y
   * @param {string} [options.name] stem of saved files
   * @param {number} [options.height] height of the canvas [px]
   * @param {boolean} [options.fromZero] whether the y axis always contains zero
   * @param {boolean} [options.bare] without toolbar (small plots)
   * @param {(series: object, index: number) => void} [options.onPick] called after a click on a point
   * @param {Link} [options.link] shared state of linked plots
   * @param {() => void} [options.onView] called after the user has changed the range
   * @param {(span: number[] | null) => void} [options.onSelect] called while a span is dragged; null: the drag has ended
   */
  constructor(options) {
    this.options = { height: 300, name: "plot", ...options };
    this.series = [];
    this.areas = [];
    this.spans = [];
    this.rules = [];
    this.link = options.link ?? new Link();
    this.link.members.add(this);
    this.view = null;
    this.span = null; // Time span of the drawn part of the loops.
    this.drawn = [];
    this.stale = true; // The canvas must be drawn again.
    this.build();
    this.stopTheme = onTheme(() => this.draw());
    this.toPaper = () => this.showPaper();
    this.fromPaper = () => this.hidePaper();
    window.addEventListener("beforeprint", this.toPaper);
    window.addEventListener("afterprint", this.fromPaper);
  }

  build() {
    const { options } = this;
    this.legend = el("div", { class: "legend" });
    this.readout = el("p", { class: "readout" });
    this.canvas = el("canvas", { class: "plot-canvas" });
    this.over = el("canvas", {
      class: "plot-over",
      tabindex: 0,
      role: "img",
      "aria-label": `${options.title}. ${options.y} over ${options.x}. Arrow keys move, plus and minus zoom, 0 shows all.`,
    });
    this.box = el("div", { class: "plot-box" }, this.canvas, this.over);
    this.box.style.height = `${options.height}px`;
    const tools = el(
      "div",
      { class: "tools" },
      button("Whole", () => this.whole(), { title: "Show all (double click, or 0)" }),
      button("SVG", () => saveSvg(this), { title: "Save this plot as SVG" }),
      button("PNG", () => savePng(this), { title: "Save this plot as PNG" }),
      button("CSV", () => saveCsv(this), { title: "Save the data shown as CSV" }),
    );
    const head = el("div", { class: "plot-head" }, el("figcaption", { text: options.title }), !options.bare && tools);
    this.node = el("figure", { class: "plot" }, head, this.legend, this.box, this.readout);
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.box);
    listen(this);
  }

  /** Stop watching sizes and colours. */
  close() {
    due.delete(this);
    this.link.members.delete(this);
    this.observer.disconnect();
    this.stopTheme();
    window.removeEventListener("beforeprint", this.toPaper);
    window.removeEventListener("afterprint", this.fromPaper);
  }

  /** Show other data; with `keepView` the ranges stay. */
  set({ series = [], areas = [], spans = [], rules = [] }, { keepView = false } = {}) {
    this.series = series.map((one) => ({ kind: "series", width: 1.4, dash: [], ...one }));
    for (const one of this.series) {
      if (one.kind === "series" && !isSorted(one.x)) one.kind = "loop";
    }
    Object.assign(this, { areas, spans, rules });
    if (!keepView) this.view = null;
    this.drawLegend();
    this.draw();
    return this;
  }

  /** Show this range of x (and of y); null: everything. */
  setView(x, y = null) {
    this.view = x ? { x, y } : null;
    this.draw();
  }

  /** Draw the part of the loops in a time span; null: everything. */
  setSpan(span) {
    this.span = span;
    if (this.series.some((one) => one.t)) this.draw();
  }

  /** Return the first sample of a series in the span, and one past the last. */
  within(one) {
    return one.t && this.span ? [lowerBound(one.t, this.span[0]), lowerBound(one.t, this.span[1])] : [0, one.x.length];
  }

  /** Change the range of all plots with this x axis. */
  look(x, y = null) {
    for (const plot of this.link.alike(this)) plot.setView(rounded(x), plot === this ? rounded(y) : null);
    this.options.onView?.();
  }

  whole() {
    this.look(null);
  }

  /** Return true if only x is zoomed, because all series are time series. */
  isFlat() {
    return this.drawn.every(({ one }) => one.kind === "series");
  }

  // ------------------------------------------------------------------------------------------ drawing

  visible() {
    return this.series.filter((one) => !this.link.hidden.has(keyOf(one)));
  }

  /** Return the ranges of both axes. */
  ranges() {
    const shown = this.visible();
    let x = this.view?.x ?? null;
    const loops = shown.some((one) => one.kind !== "series");
    if (!x) {
      const ends = [];
      for (const one of shown) {
        const found = one.kind === "series" && one.x.length ? [one.x[0], one.x[one.x.length - 1]] : extent(one.x, ...this.within(one));
        if (found) ends.push(...found);
      }
      for (const area of this.areas) if (area.x.length) ends.push(area.x[0], area.x[area.x.length - 1]);
      x = extent(ends) ?? [0, 1];
      if (loops) x = padded(x);
    }
    let y = this.view?.y ?? null;
    if (!y) {
      const ends = [];
      for (const one of shown) {
        let [from, to] = this.within(one);
        if (one.kind === "series") {
          from = Math.max(0, lowerBound(one.x, x[0]) - 1, lowerBound(one.x, one.since ?? -Infinity));
          to = Math.min(one.x.length, lowerBound(one.x, x[1]) + 1);
        }
        const found = extent(one.y, from, to);
        if (found) ends.push(...found);
      }
      for (const area of this.areas) {
        for (const side of [area.low, area.high]) {
          const found = extent(side, lowerBound(area.x, x[0]), lowerBound(area.x, x[1]));
          if (found) ends.push(...found);
        }
      }
      for (const rule of this.rules) if (rule.y !== undefined && rule.inside) ends.push(rule.y);
      if (this.options.fromZero) ends.push(0);
      y = padded(extent(ends) ?? [0, 1]);
    }
    return { x: apart(x), y: apart(y) };
  }

  /** Draw the plot in one of the next frames. */
  draw() {
    this.stale = true;
    this.node.toggleAttribute("data-drawing", true);
    if (!due.size) requestAnimationFrame(drawDue);
    due.add(this);
  }

  /** Draw the plot, or the next pieces of long loops; return true if it is complete. */
  paint() {
    if (this.stale && !this.begin()) return true;
    const { left, top, width, height } = this.frame.inner;
    const end = performance.now() + SLICE_MS;
    this.pen.clip(left, top, width, height);
    while (this.later.length && performance.now() < end) if (!this.later[0]()) this.later.shift();
    this.pen.unclip();
    return !this.later.length;
  }

  /** Draw everything except long loops; return false if the plot has no size. */
  begin() {
    const width = this.box.clientWidth;
    const height = this.box.clientHeight;
    this.stale = false;
    if (!width || !height) return false;
    const scale = window.devicePixelRatio || 1;
    for (const canvas of [this.canvas, this.over]) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const context = this.canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.pen = new CanvasPen(context);
    this.later = [];
    this.frame = this.render(this.pen, width, height, palette(), { later: this.later });
    this.drawLegendColours();
    drawOver(this, null);
    return true;
  }

  /** Draw everything with a pen and return the frame (ranges and pixel scales); with `later` long loops are postponed. */
  render(pen, width, height, colours, { legend = false, later = null } = {}) {
    const ranges = this.ranges();
    const empty = !this.series.length && !this.areas.length; // Empty plots have no ticks.
    const none = { values: [], decimals: 0 };
    const yTicks = empty ? none : ticks(...ranges.y, Math.max(3, height / 55));
    const labels = yTicks.values.map((value) => told(value, yTicks.decimals));
    const left = 30 + Math.max(38, ...labels.map((label) => pen.width(label, SMALL)));
    const top = legend ? 30 : 8;
    const right = 14;
    const bottom = 42;
    const inner = { left, top, width: Math.max(10, width - left - right), height: Math.max(10, height - top - bottom) };
    const frame = {
      ...ranges,
      inner,
      toX: linear(ranges.x, left, left + inner.width),
      toY: linear(ranges.y, top + inner.height, top),
    };
    pen.rect(0, 0, width, height, colours.back);
    const xTicks = empty ? none : ticks(...ranges.x, Math.max(3, inner.width / 90));
    for (const value of yTicks.values) {
      const y = Math.round(frame.toY(value)) + 0.5;
      pen.line([left, y, left + inner.width, y], { colour: colours.grid });
    }
    for (const value of xTicks.values) {
      const x = Math.round(frame.toX(value)) + 0.5;
      pen.line([x, top, x, top + inner.height], { colour: colours.grid });
    }
    pen.clip(left, top, inner.width, inner.height);
    for (const span of this.spans) {
      const [a, b] = [frame.toX(span.from), frame.toX(span.to)];
      pen.rect(a, top, Math.max(b - a, 0.5), inner.height, span.colour(colours));
    }
    for (const area of this.areas) this.renderArea(pen, area, frame, colours);
    this.drawn = [];
    for (const one of this.visible()) this.renderSeries(pen, one, frame, colours, later);
    for (const rule of this.rules) {
      const flat = rule.y !== undefined;
      const at = flat ? frame.toY(rule.y) : frame.toX(rule.x);
      const ends = flat ? [left, at, left + inner.width, at] : [at, top, at, top + inner.height];
      pen.line(ends, { colour: (rule.colour ?? ((c) => c.soft))(colours), width: 1.2, dash: [5, 4] });
      const place = flat ? [left + 6, at - top < 18 ? at + 14 : at - 5, "left"] : [at + 5, top + 12, "left"];
      if (rule.name) pen.text(place[0], place[1], rule.name, { colour: colours.soft, size: SMALL, align: place[2] });
    }
    pen.unclip();
    this.renderAxes(pen, frame, xTicks, yTicks, labels, height, colours);
    if (legend) this.renderLegend(pen, left, colours);
    return frame;
  }

  renderArea(pen, area, frame, colours) {
    const from = Math.max(0, lowerBound(area.x, frame.x[0]) - 1);
    const to = Math.min(area.x.length, lowerBound(area.x, frame.x[1]) + 1);
    const step = Math.max(1, Math.floor((to - from) / (2 * frame.inner.width)));
    const there = [];
    const back = [];
    for (let k = from; k < to; k += step) {
      const end = Math.min(k + step, to); // Of all samples in half a pixel only min and max are drawn.
      const [low] = extent(area.low, k, end) ?? [NaN];
      const [, high] = extent(area.high, k, end) ?? [NaN, NaN];
      if (!Number.isFinite(low) || !Number.isFinite(high)) continue;
      const x = frame.toX(area.x[k]);
      there.push(x, frame.toY(low));
      back.push([x, frame.toY(high)]);
    }
    if (there.length) pen.area([...there, ...back.reverse().flat()], area.colour(colours));
  }

  renderSeries(pen, one, frame, colours, later) {
    const { inner, toX, toY } = frame;
    const colour = one.colour(colours);
    if (one.kind === "loop") {
      const drawn = { one, pieces: [] };
      this.drawn.push(drawn);
      const [from, to] = this.within(one);
      const pieces = loopPieces(one.x, one.y, from, to, toX, toY, inner.left + inner.width, inner.top + inner.height);
      const next = () => {
        const { value, done } = pieces.next();
        if (done) return false;
        drawn.pieces.push(value);
        pen.line(value.points, { colour, width: one.width, dash: one.dash });
        return true;
      };
      if (later && to - from > MANY) later.push(next);
      else while (next());
      return;
    }
    let points;
    if (one.kind === "series") {
      const from = Math.max(0, lowerBound(one.x, frame.x[0]) - 1);
      const to = Math.min(one.x.length, lowerBound(one.x, frame.x[1]) + 2);
      points = seriesPath(one.x, one.y, from, to, toX, toY, inner.width);
    } else {
      points = new Float64Array(2 * one.x.length);
      for (let k = 0; k < one.x.length; k += 1) {
        points[2 * k] = toX(one.x[k]);
        points[2 * k + 1] = toY(one.y[k]);
      }
    }
    this.drawn.push({ one, pieces: [{ points }] });
    if (one.kind !== "points") pen.line(points, { colour, width: one.width, dash: one.dash });
    else if (one.line) pen.line(points, { colour, width: 1, dash: one.dash });
    if (one.kind === "points" || one.radius) {
      const each = (k) => (typeof one.radius === "function" ? one.radius(k) : one.radius ?? 4);
      for (let k = 0; k < points.length / 2; k += 1) {
        pen.marks(points.subarray(2 * k, 2 * k + 2), { colour, radius: each(k), hollow: one.hollow ? colours.back : "" });
      }
    }
  }

  renderAxes(pen, frame, xTicks, yTicks, labels, height, colours) {
    const { left, top, width, height: tall } = frame.inner;
    pen.line([left + 0.5, top, left + 0.5, top + tall + 0.5, left + width, top + tall + 0.5], { colour: colours.line });
    yTicks.values.forEach((value, k) => {
      pen.text(left - 7, frame.toY(value), labels[k], { colour: colours.soft, size: SMALL, align: "right", baseline: "middle" });
    });
    for (const value of xTicks.values) {
      pen.text(frame.toX(value), top + tall + 15, told(value, xTicks.decimals), { colour: colours.soft, size: SMALL, align: "center" });
    }
    pen.text(left + width, height - 8, this.options.x, { colour: colours.ink, size: 12, align: "right" });
    pen.text(12, top + tall / 2, this.options.y, { colour: colours.ink, size: 12, align: "center", turn: -Math.PI / 2, baseline: "middle" });
  }

  renderLegend(pen, left, colours) {
    let x = left;
    const said = [...this.visible().filter((one) => one.quiet !== true), ...this.areas.filter((area) => area.name), ...this.stripes()];
    for (const one of said) {
      pen.line([x, 15, x + 16, 15], { colour: one.colour(colours), width: one.y ? 2.4 : 8, dash: one.dash ?? [] });
      pen.text(x + 21, 19, keyOf(one), { colour: colours.ink, size: SMALL });
      x += 34 + pen.width(keyOf(one), SMALL);
    }
  }

  // ------------------------------------------------------------------------------------------- legend

  /** Return the first stripe with a name, as the legend entry of all stripes. */
  stripes() {
    return this.spans.filter((span) => span.name).slice(0, 1);
  }

  drawLegend() {
    const named = this.series.filter((one) => one.quiet !== true);
    const items = named.map((one) => {
      const off = this.link.hidden.has(keyOf(one));
      const swatch = el("span", { class: one.kind === "points" ? "swatch dot" : one.dash.length ? "swatch dashed" : "swatch" });
      const item = button("", () => this.link.toggle(keyOf(one)), { class: "key", "aria-pressed": String(!off), title: "Show or hide" });
      item.append(swatch, el("span", { text: keyOf(one) }));
      return { item, swatch, one };
    });
    const bands = this.areas.filter((area) => area.name);
    const blocks = [...bands, ...this.stripes()].map((one) => {
      const swatch = el("span", { class: "swatch block" });
      return { item: el("span", { class: "key" }, swatch, el("span", { text: one.name })), swatch, one };
    });
    this.keys = [...items, ...blocks];
    fill(this.legend, this.keys.length > 1 || bands.length ? this.keys.map((key) => key.item) : []);
  }

  drawLegendColours() {
    const colours = palette();
    for (const { swatch, one } of this.keys ?? []) swatch.style.setProperty("--swatch", one.colour(colours));
  }

  // ------------------------------------------------------------------------------------------- paper

  /** Show the SVG instead of the canvas during printing. */
  showPaper() {
    this.hidePaper();
    const sheet = new DOMParser().parseFromString(svgOf(this), "image/svg+xml").documentElement;
    this.paper = document.importNode(sheet, true);
    this.paper.setAttribute("class", "plot-paper");
    this.box.after(this.paper);
  }

  hidePaper() {
    if (!this.paper) return;
    this.paper.remove();
    this.paper = null;
    this.draw();
  }
}

// ---------------------------------------------------------------------------------------------- numbers

const keyOf = (one) => one.key ?? one.name;
const linear = ([low, high], a, b) => {
  const slope = (b - a) / (high - low);
  return (value) => a + (value - low) * slope;
};
const rounded = (range) => range && range.map((value) => Number(value.toPrecision(7))); // The address contains rounded values.
const apart = ([low, high]) => (high - low > 1e-12 * Math.max(1, Math.abs(low)) ? [low, high] : [low - 0.5, high + 0.5]);
const padded = ([low, high]) => {
  const margin = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
};
const told = (value, decimals) => {
  const size = Math.abs(value);
  if (size >= 1e6) return value.toExponential(1).replace("e+", "e");
  return (size < 1e-12 ? 0 : value).toFixed(decimals).replace("-", "−");
};
