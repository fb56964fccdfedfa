// Plot of time series, loops or points on uPlot, with legend, zoom, cursor and saved files.
//
// `data` is `{series, spans}` and must be a new object after each change. A series is `{name, x, y, t, colour,
// kind, width, dash, radius, hollow, line, key, since}`. Series with the same `key` share one entry of the legend. `kind` is
// `series` (default; x sorted), `loop` or `points`; `t` are the times of a loop's samples. The y axis ignores samples before
// `since`. `spans` are vertical stripes.

import { palette } from "./theme.js";
import { csvText, number, save, toggled } from "./text.js";
import { button, tags } from "./ui.js";
import { h, useEffect, useLayoutEffect, useRef, useState } from "./vendor/preact.js";

const { uPlot } = window;
const { div, figcaption, figure, p, span } = tags;
const ALL_SAMPLES_MAX = 20000; // Loops with fewer samples are drawn completely.
const STEP_MAX_PX = 8; // Longer segments of a loop are checked pixel by pixel.
const PICK_PX = 18;
const READOUT_MAX = 9;
const LOW_PX = 140; // In lower plots, the y axis shows only the unit.
const FONT = '12px "Segoe UI", "DejaVu Sans", Helvetica, Arial, sans-serif';

const keyOf = (one) => one.key ?? one.name;
const isSeries = ({ kind = "series" }) => kind === "series";

export const nth = (k) => (colours) => colours.colours[k % colours.colours.length];

/** Return the first index in sorted `x` from `low` to `high` whose value is at least `value`. */
export function lowerBound(x, value, low = 0, high = x.length) {
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** Return the index of the sample of sorted `x` that is nearest to a value. */
export function nearest(x, value) {
  const at = lowerBound(x, value);
  return at > 0 && (at === x.length || value - x[at - 1] < x[at] - value) ? at - 1 : at;
}

/** Return the lowest and highest value from `from` to `to`; null if all are NaN. */
export function extent(values, from = 0, to = values.length) {
  let [low, high] = [Infinity, -Infinity];
  for (let k = from; k < to; k += 1) {
    if (values[k] < low) low = values[k];
    if (values[k] > high) high = values[k];
  }
  return low <= high ? [low, high] : null;
}

const joined = (ranges) => extent(ranges.filter(Boolean).flat()) ?? [0, 1];
const rounded = (range) => range.map((value) => Number(value.toPrecision(7))); // The address contains these numbers.

const padded = ([low, high]) => {
  const margin = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
};

/** Return the index range of the drawn samples of a series: first index, and last index plus one. */
const samplesOf = ({ x, t }, part) =>
  t && part ? part.map((end) => lowerBound(t, end)) : [0, x.length];

export function rangesOf({ series }, { view, span: part, fromZero } = {}) {
  const isTime = series.every(isSeries);
  const ends = ({ x }) => x.length > 0 && [x[0], x[x.length - 1]];
  const whole = () =>
    isTime
      ? joined(series.map(ends))
      : padded(joined(series.map((one) => extent(one.x, ...samplesOf(one, part)))));
  const x = view?.x ?? whole();
  if (view?.y) return { x, y: view.y };
  const visible = (one, since = -Infinity) => [
    Math.max(lowerBound(one.x, x[0]) - 1, lowerBound(one.x, since), 0),
    Math.min(lowerBound(one.x, x[1]) + 1, one.x.length),
  ];
  const drawn = (one) => (isTime ? visible(one, one.since) : samplesOf(one, part));
  const y = [...series.map((one) => extent(one.y, ...drawn(one))), fromZero && [0, 0]];
  return { x, y: padded(joined(y)) };
}

function scalesOf({ bbox: { left, top, width, height }, scales: { x, y } }) {
  const [ax, ay] = [width / (x.max - x.min), -height / (y.max - y.min)];
  return [ax, left - ax * x.min, ay, top - ay * y.max];
}

/** Return the path of a time series. If there are many samples, only the extremes of each pixel column are drawn. */
export function seriesPath(u, { x, y }) {
  const path = new Path2D();
  const [ax, bx, ay, by] = scalesOf(u);
  const from = Math.max(0, lowerBound(x, u.scales.x.min) - 1);
  const to = Math.min(x.length, lowerBound(x, u.scales.x.max) + 2);
  let open = false;
  const add = (px, value) => {
    if (open) path.lineTo(px, by + ay * value);
    else path.moveTo(px, by + ay * value); // A path ignores points that are NaN.
    open = !Number.isNaN(value);
  };
  const isDense = to - from > 4 * u.bbox.width;
  for (let k = from; k < to;) {
    const column = Math.floor(bx + ax * x[k]);
    const end = isDense ? lowerBound(x, (column + 1 - bx) / ax, k + 1, to) : k + 1;
    if (!isDense) add(bx + ax * x[k], y[k]);
    else
      for (const value of [y[k], ...(extent(y, k, end) ?? []), y[end - 1]])
        add(column + 0.5, value);
    k = end;
  }
  return path;
}

/** Return the path of a loop. If there are many samples, only the segments that touch a new pixel are drawn. */
export function loopPath(u, one, part) {
  const { x, y } = one;
  const path = new Path2D();
  const [ax, bx, ay, by] = scalesOf(u);
  const { left, top, width, height } = u.bbox;
  const [from, to] = samplesOf(one, part);
  const across = Math.ceil(width) + 1;
  const down = Math.ceil(height) + 1;
  const seen = to - from > ALL_SAMPLES_MAX ? new Uint8Array(across * down) : null;
  const mark = (a, b) => {
    if (a < 0 || b < 0 || a >= across || b >= down || seen[b * across + a]) return false;
    seen[b * across + a] = 1;
    return true;
  };
  let [px, py, isOpen] = [NaN, NaN, false];
  for (let k = from; k < to; k += 1) {
    const qx = bx + ax * x[k];
    const qy = by + ay * y[k];
    const dx = qx - px;
    const dy = qy - py;
    let isNew = dx === dx && dy === dy; // False for the first sample and for NaN.
    if (seen && isNew) {
      isNew = mark((qx - left) | 0, (qy - top) | 0);
      if (dx > STEP_MAX_PX || dx < -STEP_MAX_PX || dy > STEP_MAX_PX || dy < -STEP_MAX_PX) {
        const steps = Math.min(Math.ceil(Math.max(Math.abs(dx), Math.abs(dy))), 4 * across);
        for (let s = 1; s < steps; s += 1)
          if (mark((px + (dx * s) / steps - left) | 0, (py + (dy * s) / steps - top) | 0))
            isNew = true;
      }
    }
    if (isNew && !isOpen) path.moveTo(px, py);
    if (isNew) path.lineTo(qx, qy);
    isOpen = isNew;
    px = qx;
    py = qy;
  }
  return path;
}

/** Draw vertical stripes below the series. */
function drawSpans(u, { spans = [] }, colours) {
  const [ax, bx] = scalesOf(u);
  const { top, height, left, width } = u.bbox;
  const inside = (px) => Math.min(left + width, Math.max(left, px));
  for (const { from, to, colour } of spans) {
    const [begin, end] = [inside(bx + ax * from), inside(bx + ax * to)];
    u.ctx.fillStyle = colour(colours);
    u.ctx.fillRect(begin, top, end - begin, height);
  }
}

function drawPoints(u, { series }, colours) {
  const [ax, bx, ay, by] = scalesOf(u);
  const { ctx } = u;
  const scale = uPlot.pxRatio;
  for (const one of series.filter(({ kind }) => kind === "points")) {
    ctx.strokeStyle = one.colour(colours);
    ctx.fillStyle = one.hollow ? colours.back : one.colour(colours);
    ctx.lineWidth = 1.4 * scale;
    for (let k = 0; k < one.x.length; k += 1) {
      ctx.beginPath();
      ctx.arc(bx + ax * one.x[k], by + ay * one.y[k], scale * one.radius(k), 0, 2 * Math.PI);
      ctx.fill();
      ctx.stroke();
    }
  }
}

/** Return a new uPlot in an element; `heard` are the functions onRange(view), onPick(series, k) and onCursor(u). */
function build(place, spec, colours, heard = {}) {
  const { x, y, height, span: part, isLoop } = spec;
  const unit = y.split(", ").at(-1);
  const nothing = { x: [], y: [], colour: () => colours.ink }; // uPlot needs a series.
  const data = spec.data.series.length ? spec.data : { ...spec.data, series: [nothing] };
  const range = rangesOf(data, spec);
  const axis = {
    stroke: colours.soft,
    font: FONT,
    labelFont: FONT,
    labelSize: 18,
    grid: { stroke: colours.grid, width: 1 },
    ticks: { show: false },
    values: (_u, values) => values.map((one) => String(Number(one.toPrecision(6)))),
  };
  const widest = (_u, texts) => 14 + 7 * Math.max(2, ...(texts ?? []).map((text) => text.length));
  const path = (one) => (u) => {
    if (one.kind === "points" && !one.line) return null;
    const stroke = isSeries(one) ? seriesPath(u, one) : loopPath(u, one, part);
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  };
  const curve = (one) => ({
    facets: ["x", "y"].map((scale) => ({ scale, auto: false })),
    auto: false,
    paths: path(one),
    points: { show: false },
    stroke: one.colour(colours),
    width: one.kind === "points" ? 1 : (one.width ?? 1.4),
    dash: one.dash?.length ? one.dash.map((length) => length * uPlot.pxRatio) : undefined,
  });
  const select = (u) => {
    const { left, width, top, height: tall } = u.select;
    if (width < 4) return;
    const between = (scale, from, to) => rounded([u.posToVal(from, scale), u.posToVal(to, scale)]);
    const tallRange = isLoop ? between("y", top + tall, top) : null;
    heard.onRange?.({ x: between("x", left, left + width), y: tallRange });
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  };
  const options = {
    mode: 2,
    width: Math.max(50, place.clientWidth),
    height,
    pxAlign: false,
    padding: [8, 12, 0, 0],
    legend: { show: false },
    scales: { x: { time: false, range: () => range.x }, y: { range: () => range.y } },
    cursor: {
      y: isLoop,
      points: { show: false },
      drag: { x: true, y: isLoop, dist: 5, setScale: false },
      bind: { dblclick: () => () => heard.onRange?.(null) },
    },
    axes: [
      { ...axis, size: 22, label: x, space: 70 },
      { ...axis, size: widest, label: height < LOW_PX ? unit : y, space: Math.min(40, height / 6) },
    ],
    series: [null, ...data.series.map(curve)],
    hooks: {
      drawAxes: [(u) => drawSpans(u, data, colours)],
      draw: [(u) => drawPoints(u, data, colours)],
      setCursor: [(u) => heard.onCursor?.(u)],
      setSelect: [select],
    },
  };
  const u = new uPlot(options, [null, ...data.series.map((one) => [one.x, one.y])], place);
  u.over.addEventListener("click", ({ offsetX, offsetY }) => {
    const hit = heard.onPick && hitOf(u, data, offsetX, offsetY);
    if (hit) heard.onPick(...hit);
  });
  return u;
}

/** Return the point `[series, index]` next to a pixel. */
function hitOf(u, { series }, px, py) {
  const away = (one, value, k) =>
    Math.hypot(u.valToPos(value, "x") - px, u.valToPos(one.y[k], "y") - py);
  const all = series.flatMap((one) => one.x.map((value, k) => [away(one, value, k), one, k]));
  const [[distance, ...best]] = all.sort((one, other) => one[0] - other[0]);
  return distance < PICK_PX ? best : null;
}

/** Return a shared cursor of plots: `point(t)` moves it to a time, null removes it; `heard(t)` is called then. */
export function createLink(heard = () => {}) {
  const link = { members: new Set(), t: null };
  link.point = (t, from) => {
    if (t === link.t) return;
    link.t = t;
    for (const member of link.members) if (member.u !== from) member.move(t);
    heard(t);
  };
  return link;
}

const due = []; // queue of plots to be drawn, one per animation frame

function drawDue() {
  due.shift()?.();
  if (due.length) requestAnimationFrame(drawDue);
}

/**
 * Plot with title, toolbar and legend.
 *
 * Without `view` the plot stores its range itself. With `hidden` series, the legend is outside of the plot. `link`: shared
 * cursor; `span`: time span of the loops; `fromZero`: the y axis contains zero.
 */
function Plot(props) {
  const { title, x, y, data, height = 300, isLoop = false, link, onPick } = props;
  const [own, setOwn] = useState({ view: null, hidden: [] });
  const { view = own.view, hidden = own.hidden, span: part = null } = props;
  const setView = props.onRange ?? ((next) => setOwn({ ...own, view: next }));
  const box = useRef();
  const words = useRef();
  const mine = useRef({});
  const visible = { ...data, series: data.series.filter((one) => !hidden.includes(keyOf(one))) };
  const spec = { ...props, data: visible, height, isLoop, view, span: part };

  useLayoutEffect(() => {
    const { current: member } = mine;
    const { dataset } = box.current.parentElement;
    member.move = (t) => move(member, visible, t);
    link?.members.add(member);
    const onCursor = (u) => {
      const t = u.cursor.left >= 0 && !isLoop ? u.posToVal(u.cursor.left, "x") : null;
      if (words.current) words.current.textContent = t === null ? "" : readout(spec, t);
      if (!isLoop && u === member.u) link?.point(t, u);
    };
    const draw = () => {
      if (!box.current) return;
      const before = member.u;
      member.u = build(box.current, spec, palette(), { onRange: setView, onPick, onCursor });
      before?.destroy();
      delete dataset.drawing;
    };
    dataset.drawing = "";
    due.push(draw);
    if (due.length === 1) requestAnimationFrame(drawDue);
    return () => due.includes(draw) && due.splice(due.indexOf(draw), 1);
  }, [data, palette(), JSON.stringify([view, part, hidden, x, y])]);

  useEffect(() => {
    const { current: member } = mine;
    const widen = () => member.u?.setSize({ width: Math.max(50, box.current.clientWidth), height });
    const observer = new ResizeObserver(widen);
    observer.observe(box.current);
    return () => {
      observer.disconnect();
      link?.members.delete(member);
      member.u?.destroy();
    };
  }, []);

  const press = (event) => {
    const next = moved(rangesOf(visible, spec), event.key);
    if (next === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    setView(next && { x: rounded(next.x), y: isLoop ? rounded(next.y) : null });
  };
  const toggle = (key) => setOwn({ ...own, hidden: toggled(hidden, key) });
  const tool = (text, action, tip) => button(text, action, "", { title: tip });
  const keys = "Arrow keys move, plus and minus zoom, 0 shows all.";
  const label = `${title}. ${y} over ${x}. ${keys}`;
  return figure.plot(
    div.head(
      figcaption(title),
      div.tools(
        tool("Whole", () => setView(null), "Show all (double click, or 0)"),
        tool("PNG", () => savePng(spec), "Save this plot as PNG"),
        tool("CSV", () => saveCsv(spec), "Save the data shown as CSV"),
      ),
    ),
    !props.hidden && legendOf(data, hidden, toggle),
    div({
      ref: box,
      class: "plot-box",
      tabindex: 0,
      role: "img",
      "aria-label": label,
      onkeydown: press,
    }),
    !props.hidden && !isLoop && p.readout({ ref: words }),
  );
}

/** Return the ranges after a key was pressed; null means the whole range, undefined means no change. */
function moved({ x, y }, key) {
  const shift = { ArrowLeft: -0.1, ArrowRight: 0.1 }[key] * (x[1] - x[0]);
  if (shift) return { x: x.map((value) => value + shift), y };
  const factor = { "+": 0.8, "=": 0.8, "-": 1.25 }[key];
  const zoomed = ([low, high]) =>
    [-1, 1].map((side) => (low + high + side * factor * (high - low)) / 2);
  if (factor) return { x: zoomed(x), y: zoomed(y) };
  return key === "0" ? null : undefined;
}

/** Move the cursor of a plot to a time. In a loop, move it to the sample of the first series at this time. */
function move({ u }, { series: [first] }, t) {
  if (!u || !first) return;
  const at = t !== null && first.t ? nearest(first.t, t) : null;
  const [x, y] = at === null ? [t, u.scales.y.min] : [first.x[at], first.y[at]];
  const isAway = t === null;
  const [left, top] = isAway ? [-10, -10] : [u.valToPos(x, "x"), u.valToPos(y, "y")];
  u.setCursor({ left, top }, false);
}

/** Return the values of the series at a time as text. */
function readout({ data, x }, t) {
  const values = data.series.map((one) => [one.name, one.y[nearest(one.x, t)]]);
  const [quantity, unit] = x.split(", ");
  const known = [[quantity, t, unit], ...values].filter(([, value]) => Number.isFinite(value));
  const words = ([name, value, after = ""]) => `${name} ${number(value, 4)} ${after}`;
  return known.slice(0, READOUT_MAX).map(words).join(" · ");
}

export function legendOf({ series, spans = [] }, hidden, toggle) {
  const named = [...new Map(series.map((one) => [keyOf(one), one])).values()];
  const blocks = spans.slice(0, 1);
  if (named.length + blocks.length < 2) return null;
  const swatch = ({ colour, dash }) =>
    span({
      class: dash?.length ? "swatch dashed" : "swatch",
      style: { "--swatch": colour(palette()) },
    });
  const entry = (one) => {
    const pressed = String(!hidden.includes(keyOf(one)));
    const props = { key: keyOf(one), "aria-pressed": pressed, title: "Show or hide" };
    const content = [swatch(one), span(keyOf(one))];
    return button(content, () => toggle(keyOf(one)), "key", props);
  };
  const block = (one) => span.key(swatch(one), span(one.name));
  return div.legend(named.map(entry), blocks.map(block));
}

/** Save a plot as PNG with the light colours, its title and legend. */
async function savePng(spec) {
  const place = document.createElement("div");
  place.className = "offscreen";
  document.body.append(place);
  const colours = palette(true);
  const u = build(place, spec, colours);
  await new Promise((done) => setTimeout(done)); // uPlot draws in a microtask.
  const { width, height } = u.ctx.canvas;
  const canvas = document.createElement("canvas");
  const scale = uPlot.pxRatio;
  Object.assign(canvas, { width, height: height + 44 * scale });
  const context = canvas.getContext("2d");
  const fill = (style) => Object.assign(context, { fillStyle: style, font: FONT });
  fill(colours.back).fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(u.ctx.canvas, 0, 44 * scale);
  context.scale(scale, scale);
  fill(colours.ink).fillText(spec.title, 8, 16);
  let left = 8;
  for (const [key, one] of new Map(spec.data.series.map((each) => [keyOf(each), each]))) {
    fill(one.colour(colours)).fillRect(left, 30, 16, 3);
    fill(colours.ink).fillText(key, left + 21, 35);
    left += 38 + context.measureText(key).width;
  }
  canvas.toBlob((blob) => save(`${spec.name}.png`, blob));
  u.destroy();
  place.remove();
}

/** Save the visible series inside the view as CSV: one table for a shared x, else rows by name. */
function saveCsv({ data: { series }, isLoop, view, span: part, x, y, name }) {
  const isShared = series.every((one) => one.x === series[0].x);
  const within = (one) =>
    isLoop || !view ? samplesOf(one, part) : view.x.map((end) => lowerBound(one.x, end));
  const head = isShared ? [x, ...series.map((one) => `${one.name} (${y})`)] : ["series", x, y];
  const rows = [head];
  for (const one of isShared ? series.slice(0, 1) : series) {
    const [from, to] = within(one);
    for (let k = from; k < to; k += 1)
      rows.push(
        isShared
          ? [one.x[k], ...series.map((other) => other.y[k])]
          : [one.name, one.x[k], one.y[k]],
      );
  }
  save(`${name}.csv`, new Blob(csvText(rows), { type: "text/csv" }));
}

export const plot = (props) => h(Plot, props);
