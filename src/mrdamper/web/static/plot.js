// One plot: time series, loops or points on a canvas, with axes, units, legend, zoom, crosshair and saving.
//
// A series is `{name, x, y, colour, kind, width, dash, radius, hollow, key, quiet}`; series of one `key` are hidden
// together and share what is said in the legend, where `quiet` ones are left out; `colour` is a function of the palette, `kind`
// is `series` (x sorted), `loop` or `points`. Beside series a plot takes `areas` (between two curves), `spans`
// (vertical stripes) and `rules` (straight lines). Drag to zoom (or to brush), double click for the whole, Ctrl and
// wheel to zoom, arrows + - 0 on the keyboard. Saved pictures have the light colours.

import { extent, isSorted, loopPath, lowerBound, seriesPath, ticks } from "./decimate.js";
import { button, el, fill, save } from "./dom.js";
import { CanvasPen, SvgPen } from "./pens.js";
import { onTheme, palette } from "./theme.js";

const SMALL = 11.5;
const CLICK_PX = 5;
const NEAR_PX = 18;
const CSV_ROWS = 2_500_000;

/** Return a function that gives the k-th colour of a palette. */
export const nth = (k) => (colours) => colours.colours[k % colours.colours.length];

export class Plot {
  /**
   * @param {object} options
   * @param {string} options.title said above the plot
   * @param {string} options.x label of the axis with its unit, such as "time, s"
   * @param {string} options.y
   * @param {string} [options.name] stem of saved files
   * @param {number} [options.height] of the canvas [px]
   * @param {boolean} [options.fromZero] whether the y axis always holds zero
   * @param {boolean} [options.bare] without toolbar (small plots)
   * @param {(from: number, to: number) => void} [options.onBrush] a span was drawn: brushing in place of zooming
   * @param {(series: object, index: number) => void} [options.onPick] a point was clicked
   * @param {Plot[]} [options.group] plots with the same series: what is hidden in one is hidden in all
   * @param {(view: number[] | null) => void} [options.onView] the x range changed by the user
   */
  constructor(options) {
    this.options = { height: 300, name: "plot", ...options };
    this.series = [];
    this.areas = [];
    this.spans = [];
    this.rules = [];
    this.hidden = new Set();
    this.view = null;
    this.brushed = null;
    this.drawn = [];
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
      button("SVG", () => this.saveSvg(), { title: "Save this plot as SVG" }),
      button("PNG", () => this.savePng(), { title: "Save this plot as PNG" }),
      button("CSV", () => this.saveCsv(), { title: "Save the data shown as CSV" }),
    );
    const head = el("div", { class: "plot-head" }, el("figcaption", { text: options.title }), !options.bare && tools);
    this.node = el("figure", { class: "plot" }, head, this.legend, this.box, this.readout);
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.box);
    this.listen();
  }

  /** Forget the plot: stop watching sizes and colours. */
  close() {
    this.observer.disconnect();
    this.stopTheme();
    window.removeEventListener("beforeprint", this.toPaper);
    window.removeEventListener("afterprint", this.fromPaper);
  }

  /** Show other data; the view is kept when `keepView` says so. */
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

  /** Mark a brushed span; null: none. */
  setBrush(span) {
    this.brushed = span;
    this.drawOver(null);
  }

  whole() {
    this.view = null;
    if (this.options.onBrush && this.brushed) {
      this.brushed = null;
      this.options.onBrush(null, null);
    }
    this.options.onView?.(null);
    this.draw();
  }

  // ------------------------------------------------------------------------------------------ drawing

  visible() {
    return this.series.filter((one) => !this.hidden.has(keyOf(one)));
  }

  /** Return the ranges of both axes. */
  ranges() {
    const shown = this.visible();
    let x = this.view?.x ?? null;
    const loops = shown.some((one) => one.kind !== "series");
    if (!x) {
      const ends = [];
      for (const one of shown) {
        const found = one.kind === "series" && one.x.length ? [one.x[0], one.x[one.x.length - 1]] : extent(one.x);
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
        let [from, to] = [0, one.y.length];
        if (one.kind === "series") {
          from = Math.max(0, lowerBound(one.x, x[0]) - 1);
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

  draw() {
    const width = this.box.clientWidth;
    const height = this.box.clientHeight;
    if (!width || !height) return;
    const scale = window.devicePixelRatio || 1;
    for (const canvas of [this.canvas, this.over]) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const context = this.canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.frame = this.render(new CanvasPen(context), width, height, palette());
    this.drawLegendColours();
    this.drawOver(null);
  }

  /** Draw everything with a pen; returns the frame (ranges, and how values become pixels). */
  render(pen, width, height, colours, legend = false) {
    const ranges = this.ranges();
    const empty = !this.series.length && !this.areas.length; // its axes have nothing to count yet
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
    for (const one of this.visible()) this.renderSeries(pen, one, frame, colours);
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
      const end = Math.min(k + step, to); // of several in half a pixel the least and the most are drawn
      const [low] = extent(area.low, k, end) ?? [NaN];
      const [, high] = extent(area.high, k, end) ?? [NaN, NaN];
      if (!Number.isFinite(low) || !Number.isFinite(high)) continue;
      const x = frame.toX(area.x[k]);
      there.push(x, frame.toY(low));
      back.push([x, frame.toY(high)]);
    }
    if (there.length) pen.area([...there, ...back.reverse().flat()], area.colour(colours));
  }

  renderSeries(pen, one, frame, colours) {
    const { inner, toX, toY } = frame;
    const colour = one.colour(colours);
    let points;
    if (one.kind === "series") {
      const from = Math.max(0, lowerBound(one.x, frame.x[0]) - 1);
      const to = Math.min(one.x.length, lowerBound(one.x, frame.x[1]) + 2);
      points = seriesPath(one.x, one.y, from, to, toX, toY, inner.width);
    } else if (one.kind === "loop") {
      points = loopPath(one.x, one.y, toX, toY, inner.left + inner.width, inner.top + inner.height);
    } else {
      points = new Float64Array(2 * one.x.length);
      for (let k = 0; k < one.x.length; k += 1) {
        points[2 * k] = toX(one.x[k]);
        points[2 * k + 1] = toY(one.y[k]);
      }
    }
    this.drawn.push({ one, points });
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
    const stripes = this.spans.filter((span) => span.name).slice(0, 1);
    const said = [...this.visible().filter((one) => one.quiet !== true), ...this.areas.filter((area) => area.name), ...stripes];
    for (const one of said) {
      pen.line([x, 15, x + 16, 15], { colour: one.colour(colours), width: one.y ? 2.4 : 8, dash: one.dash ?? [] });
      pen.text(x + 21, 19, keyOf(one), { colour: colours.ink, size: SMALL });
      x += 34 + pen.width(keyOf(one), SMALL);
    }
  }

  // ------------------------------------------------------------------------------------------- legend

  drawLegend() {
    const named = this.series.filter((one) => one.quiet !== true);
    const items = named.map((one) => {
      const off = this.hidden.has(keyOf(one));
      const swatch = el("span", { class: one.kind === "points" ? "swatch dot" : one.dash.length ? "swatch dashed" : "swatch" });
      const item = button("", () => this.toggle(keyOf(one)), { class: "key", "aria-pressed": String(!off), title: "Show or hide" });
      item.append(swatch, el("span", { text: keyOf(one) }));
      return { item, swatch, one };
    });
    const bands = this.areas.filter((area) => area.name).map((area) => {
      const swatch = el("span", { class: "swatch block" });
      return { item: el("span", { class: "key" }, swatch, el("span", { text: area.name })), swatch, one: area };
    });
    const stripes = this.spans.filter((span) => span.name).slice(0, 1).map((span) => {
      const swatch = el("span", { class: "swatch block" });
      return { item: el("span", { class: "key" }, swatch, el("span", { text: span.name })), swatch, one: span };
    });
    this.keys = [...items, ...bands, ...stripes];
    fill(this.legend, this.keys.length > 1 || bands.length ? this.keys.map((key) => key.item) : []);
  }

  drawLegendColours() {
    const colours = palette();
    for (const { swatch, one } of this.keys ?? []) swatch.style.setProperty("--swatch", one.colour(colours));
  }

  toggle(key) {
    if (this.hidden.has(key)) this.hidden.delete(key);
    else this.hidden.add(key);
    for (const plot of this.options.group ?? [this]) {
      plot.hidden = this.hidden;
      plot.drawLegend();
      plot.draw();
    }
  }

  // ------------------------------------------------------------------------------- crosshair and selection

  /** Draw what lies over the plot: the brushed span, a selection in the making, the crosshair. */
  drawOver(pointer, selection = null) {
    const context = this.over.getContext("2d");
    const scale = window.devicePixelRatio || 1;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, this.over.width, this.over.height);
    const { frame } = this;
    if (!frame) return;
    const colours = palette();
    const { left, top, width, height } = frame.inner;
    const pen = new CanvasPen(context);
    if (this.brushed) {
      const a = Math.max(left, frame.toX(this.brushed[0]));
      const b = Math.min(left + width, frame.toX(this.brushed[1]));
      if (b > a) {
        pen.rect(a, top, b - a, height, colours.brush);
        for (const x of [a, b]) pen.line([x, top, x, top + height], { colour: colours.accent, width: 1.2 });
      }
    }
    if (selection) {
      const [x0, x1] = [selection.x0, selection.x1].sort((a, b) => a - b);
      const [y0, y1] = selection.flat ? [top, top + height] : [selection.y0, selection.y1].sort((a, b) => a - b);
      pen.rect(x0, y0, x1 - x0, y1 - y0, colours.brush);
    } else if (pointer) this.drawCrosshair(pen, pointer, colours);
    else this.readout.textContent = "";
  }

  drawCrosshair(pen, pointer, colours) {
    const { frame } = this;
    const { left, top, width, height } = frame.inner;
    if (pointer.x < left || pointer.x > left + width || pointer.y < top || pointer.y > top + height) {
      this.readout.textContent = "";
      return;
    }
    const said = [];
    const [xName, xUnit] = parted(this.options.x);
    const [, yUnit] = parted(this.options.y);
    const x = frame.x[0] + ((pointer.x - left) / width) * (frame.x[1] - frame.x[0]);
    pen.line([pointer.x, top, pointer.x, top + height], { colour: colours.soft, width: 0.8, dash: [3, 3] });
    const sorted = this.drawn.filter(({ one }) => one.kind === "series");
    if (sorted.length) {
      said.push(`${xName} ${precise(x, frame.x)} ${xUnit}`);
      for (const { one } of sorted) {
        const at = nearest(one.x, x);
        if (at < 0) continue;
        pen.marks([frame.toX(one.x[at]), frame.toY(one.y[at])], { colour: one.colour(colours), radius: 3 });
        said.push(`${one.name} ${precise(one.y[at], frame.y)} ${yUnit}`);
      }
    } else {
      const hit = this.hit(pointer, Infinity);
      if (hit) {
        pen.line([left, hit.y, left + width, hit.y], { colour: colours.soft, width: 0.8, dash: [3, 3] });
        pen.marks([hit.x, hit.y], { colour: hit.one.colour(colours), radius: 3.5 });
        const values = [unlinear(hit.x, frame.x, left, left + width), unlinear(hit.y, frame.y, top + height, top)];
        const shown = hit.one.words ? ` · ${hit.one.words(hit.index)}` : "";
        said.push(
          `${hit.one.name}: ${xName} ${precise(values[0], frame.x)} ${xUnit} · ${precise(values[1], frame.y)} ${yUnit}${shown}`,
        );
      }
    }
    this.readout.textContent = said.slice(0, 8).join("  ·  ");
  }

  /** Return the drawn point next to a pointer, or null. */
  hit(pointer, within) {
    let best = null;
    let least = within * within;
    for (const { one, points } of this.drawn) {
      for (let k = 0; k < points.length; k += 2) {
        const gap = (points[k] - pointer.x) ** 2 + (points[k + 1] - pointer.y) ** 2;
        if (gap < least) {
          least = gap;
          best = { one, index: k / 2, x: points[k], y: points[k + 1] };
        }
      }
    }
    return best;
  }

  listen() {
    const { over } = this;
    let start = null;
    const place = (event) => {
      const box = over.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top };
    };
    const flat = () => this.drawn.every(({ one }) => one.kind === "series");
    over.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      start = place(event);
      over.setPointerCapture(event.pointerId);
    });
    over.addEventListener("pointermove", (event) => {
      const here = place(event);
      if (start && Math.hypot(here.x - start.x, here.y - start.y) > CLICK_PX) {
        this.drawOver(null, { x0: start.x, y0: start.y, x1: here.x, y1: here.y, flat: flat() });
      } else this.drawOver(here);
    });
    over.addEventListener("pointerleave", () => this.drawOver(null));
    over.addEventListener("pointercancel", () => {
      start = null;
      this.drawOver(null);
    });
    over.addEventListener("pointerup", (event) => {
      if (!start) return;
      const [from, here] = [start, place(event)];
      start = null;
      if (Math.hypot(here.x - from.x, here.y - from.y) <= CLICK_PX) {
        const hit = this.options.onPick && this.hit(here, NEAR_PX);
        if (hit) this.options.onPick(hit.one, hit.index);
        return;
      }
      this.selected(from, here, flat());
    });
    over.addEventListener("dblclick", () => this.whole());
    over.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey || !this.frame) return;
        event.preventDefault();
        this.zoom(event.deltaY > 0 ? 1.25 : 0.8, place(event).x);
      },
      { passive: false },
    );
    over.addEventListener("keydown", (event) => this.key(event));
  }

  selected(from, here, flat) {
    const { inner, x, y } = this.frame;
    const keep = (value, low, high) => Math.min(high, Math.max(low, value));
    const inX = (px) => unlinear(keep(px, inner.left, inner.left + inner.width), x, inner.left, inner.left + inner.width);
    const inY = (py) => unlinear(keep(py, inner.top, inner.top + inner.height), y, inner.top + inner.height, inner.top);
    const xs = [inX(from.x), inX(here.x)].sort((a, b) => a - b);
    const ys = [inY(from.y), inY(here.y)].sort((a, b) => a - b);
    if (this.options.onBrush) {
      this.brushed = xs;
      this.drawOver(null);
      this.options.onBrush(xs[0], xs[1]);
      return;
    }
    this.view = { x: xs, y: flat ? null : ys };
    this.options.onView?.(xs);
    this.draw();
  }

  zoom(factor, atPixel = null) {
    const { inner, x, y } = this.frame;
    const share = atPixel === null ? 0.5 : (atPixel - inner.left) / inner.width;
    const centre = x[0] + share * (x[1] - x[0]);
    const next = [centre + (x[0] - centre) * factor, centre + (x[1] - centre) * factor];
    const flat = this.drawn.every(({ one }) => one.kind === "series");
    const middle = (y[0] + y[1]) / 2;
    this.view = { x: next, y: flat ? null : y.map((value) => middle + (value - middle) * factor) };
    this.options.onView?.(next);
    this.draw();
  }

  key(event) {
    if (!this.frame) return;
    const { x } = this.frame;
    const step = (x[1] - x[0]) * 0.1;
    const moves = { ArrowLeft: -step, ArrowRight: step };
    if (event.key in moves) {
      const by = moves[event.key];
      if (this.options.onBrush && this.brushed) {
        this.brushed = this.brushed.map((value) => value + by / 5);
        this.drawOver(null);
        this.options.onBrush(...this.brushed);
      } else {
        this.view = { x: x.map((value) => value + by), y: this.view?.y ?? null };
        this.options.onView?.(this.view.x);
        this.draw();
      }
    } else if (event.key === "+" || event.key === "=") this.zoom(0.8);
    else if (event.key === "-") this.zoom(1.25);
    else if (event.key === "0" || event.key === "Escape") this.whole();
    else return;
    event.preventDefault();
  }

  // ------------------------------------------------------------------------------------------- saving

  /** Return the plot as an SVG document, in the light colours. */
  svg() {
    const [width, height] = [this.box.clientWidth || 800, this.options.height + 22];
    const measure = new CanvasPen(this.canvas.getContext("2d"));
    const pen = new SvgPen(width, height, (said, size) => measure.width(said, size));
    this.render(pen, width, height, palette(true), true);
    return pen.document();
  }

  /** Put the SVG in the canvas' place while the page is printed. */
  showPaper() {
    this.hidePaper();
    const sheet = new DOMParser().parseFromString(this.svg(), "image/svg+xml").documentElement;
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

  saveSvg() {
    save(`${this.options.name}.svg`, new Blob([this.svg()], { type: "image/svg+xml" }));
    this.draw();
  }

  savePng() {
    const [width, height] = [this.box.clientWidth || 800, this.options.height + 22];
    const canvas = el("canvas", { width: 2 * width, height: 2 * height });
    const context = canvas.getContext("2d");
    context.setTransform(2, 0, 0, 2, 0, 0);
    this.render(new CanvasPen(context), width, height, palette(true), true);
    canvas.toBlob((blob) => save(`${this.options.name}.png`, blob));
    this.draw();
  }

  /** Return the visible series inside the view as CSV, in pieces: one table where they share x, else in rows by name. */
  csv() {
    const shown = this.visible();
    if (!shown.length) return [""];
    const quoted = (said) => `"${guarded(String(said)).replaceAll('"', '""')}"`;
    const shared = shown.every((one) => one.x === shown[0].x);
    const [xName, yName] = [this.options.x, this.options.y].map((label) => label);
    const within = (one) => {
      if (one.kind !== "series" || !this.view) return [0, one.x.length];
      return [lowerBound(one.x, this.view.x[0]), lowerBound(one.x, this.view.x[1])];
    };
    const pieces = [];
    let rows = 0;
    if (shared) {
      const [from, to] = within(shown[0]);
      pieces.push(`${[xName, ...shown.map((one) => `${one.name} (${yName})`)].map(quoted).join(",")}\n`);
      let lines = [];
      for (let k = from; k < to && rows < CSV_ROWS; k += 1, rows += 1) {
        lines.push([shown[0].x[k], ...shown.map((one) => one.y[k])].map(plain).join(","));
        if (lines.length === 20000) {
          pieces.push(`${lines.join("\n")}\n`);
          lines = [];
        }
      }
      pieces.push(lines.length ? `${lines.join("\n")}\n` : "");
      return pieces;
    }
    pieces.push(`${["series", xName, yName].map(quoted).join(",")}\n`);
    for (const one of shown) {
      const [from, to] = within(one);
      const lines = [];
      for (let k = from; k < to && rows < CSV_ROWS; k += 1, rows += 1) {
        lines.push(`${quoted(one.name)},${plain(one.x[k])},${plain(one.y[k])}`);
      }
      pieces.push(lines.length ? `${lines.join("\n")}\n` : "");
    }
    return pieces;
  }

  saveCsv() {
    save(`${this.options.name}.csv`, new Blob(this.csv(), { type: "text/csv" }));
  }
}

// ---------------------------------------------------------------------------------------------- numbers

const keyOf = (one) => one.key ?? one.name;
const linear = ([low, high], a, b) => {
  const slope = (b - a) / (high - low);
  return (value) => a + (value - low) * slope;
};
const unlinear = (pixel, [low, high], a, b) => low + ((pixel - a) / (b - a)) * (high - low);
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
const precise = (value, [low, high]) => {
  const decimals = Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(Math.max(high - low, 1e-12)))));
  return Number.isFinite(value) ? value.toFixed(decimals).replace("-", "−") : "–";
};
const plain = (value) => (Number.isFinite(value) ? String(Number(Number(value).toPrecision(9))) : "");
const guarded = (said) => (/^[=+\-@\t\r]/.test(said) ? `'${said}` : said); // a spreadsheet would run it
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
