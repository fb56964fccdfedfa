// Plot of time series, loops or points on uPlot, with legend, zoom, cursor and saved files.
//
// `data` is `{series, areas, spans, rules}` and must be a new object after each change. A series is `{name, x, y, t, colour,
// kind, width, dash, radius, hollow, key, quiet, since}`. Series with the same `key` share one entry of the legend; `quiet`
// series have no entry. `kind` is `series` (x sorted), `loop` or `points`; `t` are the times of a loop's samples. The y axis
// ignores samples before `since`. `areas` are between two curves, `spans` are vertical stripes, `rules` are straight lines.

import { palette } from "./theme.js";
import { button, csvText, save, tags } from "./ui.js";
import { h, useEffect, useLayoutEffect, useRef, useState } from "./vendor/preact.js";

const { uPlot } = window;
const { div, figcaption, figure, p, span } = tags;
const ALL_SAMPLES_MAX = 20000; // Loops with fewer samples are drawn completely.
const STEP_MAX_PX = 8; // Longer segments of a loop are checked pixel by pixel.
const PICK_PX = 18;
const FONT = '12px "Segoe UI", "DejaVu Sans", Helvetica, Arial, sans-serif';

const keyOf = (one) => one.key ?? one.name;

/** Return the function of the k-th colour of a palette. */
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
    const value = values[k];
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low <= high ? [low, high] : null;
}

// ------------------------------------------------------------------------------------------------ ranges

const padded = ([low, high]) => {
  const margin = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
};
const joined = (ranges) => extent(ranges.filter(Boolean).flat());

/** Return the drawn samples of a series: the first index, and one past the last. */
function samplesOf(one, span) {
  if (!one.t || !span) return [0, one.x.length];
  return [lowerBound(one.t, span[0]), lowerBound(one.t, span[1])];
}

/** Return the ranges of both axes. */
export function rangesOf({ series, areas = [], rules = [] }, { view, span, fromZero } = {}) {
  const isTime = series.every((one) => (one.kind ?? "series") === "series");
  const ends = ({ x }) => (x.length ? [x[0], x[x.length - 1]] : null);
  let x = view?.x;
  if (!x && isTime) x = joined([...series, ...areas].map(ends)) ?? [0, 1];
  x ??= padded(joined(series.map((one) => extent(one.x, ...samplesOf(one, span)))) ?? [0, 1]);
  const visible = (one, since = -Infinity) => [
    Math.max(lowerBound(one.x, x[0]) - 1, lowerBound(one.x, since), 0),
    Math.min(lowerBound(one.x, x[1]) + 1, one.x.length),
  ];
  const y = view?.y ?? [
    ...series.map((one) =>
      extent(one.y, ...(isTime ? visible(one, one.since) : samplesOf(one, span))),
    ),
    ...areas.flatMap((one) => [one.low, one.high].map((side) => extent(side, ...visible(one)))),
    ...rules.map((rule) => rule.inside && [rule.y, rule.y]),
    fromZero && [0, 0],
  ];
  return { x, y: view?.y ?? padded(joined(y) ?? [0, 1]) };
}

// ------------------------------------------------------------------------------------------------- paths

/** Return the linear functions of the two axes to pixels of the canvas. */
function scalesOf({ bbox: { left, top, width, height }, scales: { x, y } }) {
  const [ax, ay] = [width / (x.max - x.min), -height / (y.max - y.min)];
  return [ax, left - ax * x.min, ay, top - ay * y.max];
}

/** Return the path of a time series; of many samples only the extremes of each pixel column. */
export function seriesPath(u, { x, y }) {
  const path = new Path2D();
  const [ax, bx, ay, by] = scalesOf(u);
  const from = Math.max(0, lowerBound(x, u.scales.x.min) - 1);
  const to = Math.min(x.length, lowerBound(x, u.scales.x.max) + 2);
  let open = false;
  const add = (px, value) => {
    if (Number.isNaN(value)) open = false;
    else if (open) path.lineTo(px, by + ay * value);
    else path.moveTo(px, by + ay * value);
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

/** Return the path of a loop; of many samples only the segments that touch a new pixel. */
export function loopPath(u, one, span) {
  const { x, y } = one;
  const path = new Path2D();
  const [ax, bx, ay, by] = scalesOf(u);
  const { left, top, width, height } = u.bbox;
  const [from, to] = samplesOf(one, span);
  const across = Math.ceil(width) + 1;
  const down = Math.ceil(height) + 1;
  const seen = to - from > ALL_SAMPLES_MAX ? new Uint8Array(across * down) : null;
  const mark = (a, b) => {
    if (a < 0 || b < 0 || a >= across || b >= down || seen[b * across + a]) return false;
    seen[b * across + a] = 1;
    return true;
  };
  let px = NaN;
  let py = NaN;
  let isOpen = false;
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
        for (let s = 1; s < steps; s += 1) {
          if (mark((px + (dx * s) / steps - left) | 0, (py + (dy * s) / steps - top) | 0))
            isNew = true;
        }
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

/** Draw stripes and areas below the series. */
function drawBelow(u, { areas = [], spans = [] }, colours) {
  const [ax, bx, ay, by] = scalesOf(u);
  const { ctx, bbox } = u;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const one of spans) {
    ctx.fillStyle = one.colour(colours);
    ctx.fillRect(bx + ax * one.from, bbox.top, ax * (one.to - one.from), bbox.height);
  }
  for (const { x, low, high, colour } of areas) {
    const sides = [low, high].map((side) =>
      x.map((value, k) => [bx + ax * value, by + ay * side[k]]),
    );
    ctx.fillStyle = colour(colours);
    ctx.beginPath();
    for (const [px, py] of [...sides[0], ...sides[1].reverse()]) ctx.lineTo(px, py);
    ctx.fill();
  }
  ctx.restore();
}

/** Draw points and rules above the series. */
function drawAbove(u, { series, rules = [] }, colours) {
  const [ax, bx, ay, by] = scalesOf(u);
  const { ctx, bbox } = u;
  const scale = uPlot.pxRatio;
  for (const one of series.filter(({ kind }) => kind === "points")) {
    ctx.strokeStyle = one.colour(colours);
    ctx.fillStyle = one.hollow ? colours.back : one.colour(colours);
    ctx.lineWidth = 1.4 * scale;
    for (let k = 0; k < one.x.length; k += 1) {
      ctx.beginPath();
      ctx.arc(
        bx + ax * one.x[k],
        by + ay * one.y[k],
        scale * (one.radius?.(k) ?? 5),
        0,
        2 * Math.PI,
      );
      ctx.fill();
      ctx.stroke();
    }
  }
  ctx.setLineDash([5 * scale, 4 * scale]);
  for (const { y, name } of rules) {
    ctx.strokeStyle = colours.soft;
    ctx.fillStyle = colours.soft;
    ctx.lineWidth = scale;
    ctx.beginPath();
    ctx.moveTo(bbox.left, by + ay * y);
    ctx.lineTo(bbox.left + bbox.width, by + ay * y);
    ctx.stroke();
    ctx.textAlign = "left";
    if (name) ctx.fillText(name, bbox.left + 6 * scale, by + ay * y - 5 * scale);
  }
  ctx.setLineDash([]);
}

// ----------------------------------------------------------------------------------------------- drawing

const rounded = (range) => range.map((value) => Number(value.toPrecision(7))); // The address contains these numbers.

/** Return a new uPlot in an element; `heard` are the functions onRange(view), onPick(series, k) and onCursor(u). */
function build(place, spec, colours, heard = {}) {
  const { x, y, height, span, isLoop } = spec;
  const nothing = { x: [], y: [], colour: () => colours.ink }; // uPlot needs a series.
  const data = spec.data.series.length ? spec.data : { ...spec.data, series: [nothing] };
  const range = rangesOf(data, spec);
  const label = (u, values, _axis, _space, step) => {
    const decimals = Math.min(12, Math.max(0, Math.ceil(-Math.log10(step) - 1e-9)));
    const digits =
      step * 10 ** decimals > 2.4 && step * 10 ** decimals < 2.6 ? decimals + 1 : decimals;
    return values.map((value) =>
      Math.abs(value) >= 1e6 ? value.toExponential(1) : value.toFixed(digits),
    );
  };
  const axis = {
    stroke: colours.soft,
    font: FONT,
    labelFont: FONT,
    labelSize: 18,
    grid: { stroke: colours.grid, width: 1 },
    ticks: { show: false },
    values: label,
  };
  const widest = (u, values) => 14 + 7 * Math.max(2, ...(values ?? []).map((text) => text.length));
  const path = (one) => (u) => {
    if (one.kind === "points" && !one.line) return null;
    const stroke =
      (one.kind ?? "series") === "series" ? seriesPath(u, one) : loopPath(u, one, span);
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  };
  const dashOf = (one) =>
    one.dash?.length ? one.dash.map((length) => length * uPlot.pxRatio) : undefined;
  const facets = ["x", "y"].map((scale) => ({ scale, auto: false }));
  const options = {
    mode: 2,
    width: Math.max(50, place.clientWidth),
    height,
    pxAlign: false,
    padding: [8, 12, 0, 0],
    legend: { show: false },
    scales: {
      x: { time: false, range: () => range.x },
      y: { range: () => range.y },
    },
    cursor: {
      y: isLoop,
      points: { show: false },
      drag: { x: true, y: isLoop, dist: 5, setScale: false },
      bind: { dblclick: () => () => heard.onRange?.(null) },
    },
    axes: [
      { ...axis, size: 22, label: x, space: 70 },
      { ...axis, size: widest, label: y, space: Math.min(40, height / 6) },
    ],
    series: [
      null,
      ...data.series.map((one) => ({
        facets,
        auto: false,
        paths: path(one),
        points: { show: false },
        stroke: one.colour(colours),
        width: one.kind === "points" ? 1 : (one.width ?? 1.4),
        dash: dashOf(one),
      })),
    ],
    hooks: {
      drawAxes: [(u) => drawBelow(u, data, colours)],
      draw: [(u) => drawAbove(u, data, colours)],
      setCursor: [(u) => heard.onCursor?.(u)],
      setSelect: [
        (u) => {
          const { left, width, top, height: tall } = u.select;
          if (width < 4) return;
          const at = (pixel, scale) => u.posToVal(pixel, scale);
          heard.onRange?.({
            x: rounded([at(left, "x"), at(left + width, "x")]),
            y: isLoop ? rounded([at(top + tall, "y"), at(top, "y")]) : null,
          });
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        },
      ],
    },
  };
  const u = new uPlot(options, [null, ...data.series.map((one) => [one.x, one.y])], place);
  u.over.addEventListener("click", (event) => {
    const found = heard.onPick && hitOf(u, data, event.offsetX, event.offsetY);
    if (found) heard.onPick(...found);
  });
  return u;
}

/** Return the point `[series, index]` next to a pixel. */
function hitOf(u, { series }, px, py) {
  const near = series.flatMap((one) =>
    Array.from(one.x, (value, k) => [
      Math.hypot(u.valToPos(value, "x") - px, u.valToPos(one.y[k], "y") - py),
      one,
      k,
    ]),
  );
  const [best] = near.sort((a, b) => a[0] - b[0]);
  return best?.[0] < PICK_PX ? best.slice(1) : null;
}

/** Shared cursor of plots: `point(t)` moves it to a time, null removes it; `heard(t)` is called then. */
export class Link {
  constructor(heard = null) {
    Object.assign(this, { members: new Set(), heard, t: null });
  }

  point(t, from) {
    if (t === this.t) return;
    this.t = t;
    for (const member of this.members) if (member.u !== from) member.move(t);
    this.heard?.(t);
  }
}

const due = []; // Plots to be drawn, one in a frame.

function drawDue() {
  due.shift()?.();
  if (due.length) requestAnimationFrame(drawDue);
}

/**
 * Plot with title, toolbar and legend.
 *
 * Without `view` and `hidden` the plot holds its own range and hidden series. `link`: shared cursor; `span`: time span of the
 * loops; `bare`: without toolbar; `fromZero`: the y axis contains zero.
 */
export function Plot(props) {
  const {
    title,
    x,
    y,
    data,
    height = 300,
    isLoop = false,
    span: part = null,
    link,
    name,
    bare,
    onPick,
  } = props;
  const [own, setOwn] = useState({ view: null, hidden: [] });
  const [view, hidden] = [
    props.view === undefined ? own.view : props.view,
    props.hidden ?? own.hidden,
  ];
  const setView = props.onRange ?? ((next) => setOwn({ ...own, view: next }));
  const box = useRef();
  const words = useRef();
  const mine = useRef({});
  const visible = { ...data, series: data.series.filter((one) => !hidden.includes(keyOf(one))) };
  const spec = { ...props, data: visible, height, isLoop, view, span: part };

  useLayoutEffect(() => {
    const { current: member } = mine;
    member.move = (t) => move(member, visible, t);
    link?.members.add(member);
    const onCursor = (u) => {
      const t = u.cursor.left >= 0 && !isLoop ? u.posToVal(u.cursor.left, "x") : null;
      if (words.current) words.current.textContent = t === null ? "" : readout(spec, t);
      if (!isLoop && u === member.u) link?.point(t, u);
    };
    const draw = () => {
      const before = member.u;
      if (!box.current) return;
      member.u = build(box.current, spec, palette(), { onRange: setView, onPick, onCursor });
      before?.destroy();
      box.current.closest("figure").removeAttribute("data-drawing");
    };
    box.current.closest("figure").setAttribute("data-drawing", "");
    due.push(draw);
    if (due.length === 1) requestAnimationFrame(drawDue);
    return () => due.includes(draw) && due.splice(due.indexOf(draw), 1);
  }, [data, palette(), JSON.stringify([view, part, hidden, x, y])]);

  useEffect(() => {
    const { current: member } = mine;
    const observer = new ResizeObserver(() =>
      member.u?.setSize({ width: Math.max(50, box.current.clientWidth), height }),
    );
    observer.observe(box.current);
    return () => {
      observer.disconnect();
      link?.members.delete(member);
      member.u?.destroy();
    };
  }, []);

  const press = (event) => {
    const range = rangesOf(visible, spec);
    const next = moved(range, event.key);
    if (next === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    setView(next && { x: rounded(next.x), y: isLoop ? rounded(next.y) : null });
  };
  const toggle = (key) => {
    const next = hidden.includes(key) ? hidden.filter((one) => one !== key) : [...hidden, key];
    if (props.onHide) props.onHide(next);
    else setOwn({ ...own, hidden: next });
  };
  const tools = [
    button("Whole", () => setView(null), { title: "Show all (double click, or 0)" }),
    button("PNG", () => savePng(spec), { title: "Save this plot as PNG" }),
    button("CSV", () => saveCsv(spec), { title: "Save the data shown as CSV" }),
  ];
  return figure(
    { class: "plot" },
    div({ class: "plot-head" }, figcaption(title), !bare && div({ class: "tools" }, tools)),
    props.legend !== false && legendOf(data, hidden, toggle),
    div({
      ref: box,
      class: "plot-box",
      tabindex: 0,
      role: "img",
      "aria-label": `${title}. ${y} over ${x}. Arrow keys move, plus and minus zoom, 0 shows all.`,
      onkeydown: press,
    }),
    props.legend !== false && !isLoop && p({ class: "readout", ref: words }),
  );
}

/** Return the ranges after a key: null is everything, undefined is no change. */
function moved({ x, y }, key) {
  const shift = { ArrowLeft: -0.1, ArrowRight: 0.1 }[key] * (x[1] - x[0]);
  if (shift) return { x: x.map((value) => value + shift), y };
  const factor = { "+": 0.8, "=": 0.8, "-": 1.25 }[key];
  const zoomed = ([low, high]) =>
    [-1, 1].map((side) => (low + high + side * factor * (high - low)) / 2);
  if (factor) return { x: zoomed(x), y: zoomed(y) };
  return key === "0" || key === "Escape" ? null : undefined;
}

/** Move the cursor of a plot to a time, in a loop to the sample of the first series at this time. */
function move({ u }, { series: [first] }, t) {
  if (!u || !first) return;
  const at = t !== null && first.t ? nearest(first.t, t) : null;
  const [x, y] = at === null ? [t, u.scales.y.min] : [first.x[at], first.y[at]];
  u.setCursor(
    t === null ? { left: -10, top: -10 } : { left: u.valToPos(x, "x"), top: u.valToPos(y, "y") },
    false,
  );
}

/** Return the values of the series at a time as text. */
function readout({ data, x }, t) {
  const decimals = (value) =>
    Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(Math.abs(value) || 1))));
  const values = data.series.map((one) => [one.name, one.y[nearest(one.x, t)]]);
  const [quantity, unit] = x.split(", ");
  return [[quantity, t, unit], ...values]
    .filter(([, value]) => Number.isFinite(value))
    .slice(0, 9)
    .map(([name, value, after = ""]) => `${name} ${value.toFixed(decimals(value))} ${after}`)
    .join(" · ");
}

/** Return the buttons of the legend. */
export function legendOf({ series = [], areas = [], spans = [] }, hidden, toggle) {
  const colours = palette();
  const named = [
    ...new Map(series.filter((one) => !one.quiet).map((one) => [keyOf(one), one])).values(),
  ];
  const blocks = [
    ...areas.filter((one) => one.name),
    ...spans.filter((one) => one.name).slice(0, 1),
  ];
  if (named.length + blocks.length < 2) return null;
  const swatch = (one, kind) =>
    span({ class: `swatch ${kind}`, style: { "--swatch": one.colour(colours) } });
  const kindOf = (one) => (one.kind === "points" ? "dot" : one.dash?.length ? "dashed" : "");
  return div(
    { class: "legend" },
    named.map((one) =>
      button([swatch(one, kindOf(one)), span(keyOf(one))], () => toggle(keyOf(one)), {
        class: "key",
        key: keyOf(one),
        "aria-pressed": String(!hidden.includes(keyOf(one))),
        title: "Show or hide",
      }),
    ),
    blocks.map((one) => span({ class: "key" }, swatch(one, "block"), span(one.name))),
  );
}

// ------------------------------------------------------------------------------------------------- files

/** Save a plot as PNG with the light colours, its title and legend. */
async function savePng(spec) {
  const place = document.createElement("div");
  place.className = "offscreen";
  document.body.append(place);
  const colours = palette(true);
  const u = build(place, spec, colours);
  await new Promise((done) => setTimeout(done)); // uPlot draws in a microtask.
  const picture = u.ctx.canvas;
  const [canvas, head] = [document.createElement("canvas"), 44 * uPlot.pxRatio];
  Object.assign(canvas, { width: picture.width, height: picture.height + head });
  const context = canvas.getContext("2d");
  context.fillStyle = colours.back;
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(picture, 0, head);
  context.scale(uPlot.pxRatio, uPlot.pxRatio);
  context.font = FONT;
  context.fillStyle = colours.ink;
  context.fillText(spec.title, 8, 16);
  let left = 8;
  for (const [key, one] of new Map(spec.data.series.map((each) => [keyOf(each), each]))) {
    context.fillStyle = one.colour(colours);
    context.fillRect(left, 30, 16, 3);
    context.fillStyle = colours.ink;
    context.fillText(key, left + 21, 35);
    left += 38 + context.measureText(key).width;
  }
  canvas.toBlob((blob) => save(`${spec.name}.png`, blob));
  u.destroy();
  place.remove();
}

/** Save the visible series inside the view as CSV: one table for a shared x, else rows by name. */
function saveCsv(spec) {
  const { series } = spec.data;
  const isShared = series.every((one) => one.x === series[0].x);
  const within = (one) => {
    if (spec.isLoop || !spec.view) return samplesOf(one, spec.span);
    return [lowerBound(one.x, spec.view.x[0]), lowerBound(one.x, spec.view.x[1])];
  };
  const head = isShared
    ? [spec.x, ...series.map((one) => `${one.name} (${spec.y})`)]
    : ["series", spec.x, spec.y];
  const rows = [head];
  for (const one of isShared ? series.slice(0, 1) : series) {
    const [from, to] = within(one);
    for (let k = from; k < to; k += 1) {
      rows.push(
        isShared
          ? [one.x[k], ...series.map((other) => other.y[k])]
          : [one.name, one.x[k], one.y[k]],
      );
    }
  }
  save(`${spec.name}.csv`, new Blob(csvText(rows), { type: "text/csv" }));
}

/** Return a plot as a vnode. */
export const plot = (props) => h(Plot, props);
