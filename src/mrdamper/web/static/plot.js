// Plot of time series, loops or points on uPlot, with legend, zoom, cursor and saved files.
//
// `data` is `{series, spans}`, a new object after each change. A series is `{name, x, y, t, colour, kind, width, dash,
// radius, hollow, line, key, since}`. Series with the same `key` share one entry of the legend. `kind` is `series`
// (default; x sorted), `loop` or `points`; `t`: times of a loop; the y axis ignores samples before `since`.

import { palette } from "./theme.js";
import { csvText, number, save, toggled } from "./text.js";
import { button, tags } from "./ui.js";
import { h, useEffect, useLayoutEffect, useRef, useState } from "./vendor/preact.js";

const { uPlot } = window;
const { div, figcaption, figure, p, span } = tags;
const ALL_SAMPLES_MAX = 20000; // Loops with fewer samples are drawn completely.
const PIECE_SAMPLES = 100000; // samples of a loop between two checks of the elapsed time
const FRAME_MS = 12; // time in each animation frame that is used to prepare loops
const STEP_MAX_PX = 8; // Longer segments of a loop are checked pixel by pixel.
const READOUT_MAX = 9;
const LOW_PX = 140; // In a plot of less height, the label of the y axis is only the unit.
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

export function nearest(x, value) {
	const at = lowerBound(x, value);
	return at > 0 && (at === x.length || value - x[at - 1] < x[at] - value) ? at - 1 : at;
}

/** Return the lowest and highest value; null if all are NaN. */
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

/** Return the path of samples; a sample that is NaN interrupts it. */
function line(u, { x, y }, from = 0, to = x.length) {
	const path = new Path2D();
	const [ax, bx, ay, by] = scalesOf(u);
	let isOpen = false;
	for (let k = from; k < to; k += 1) {
		if (isOpen) path.lineTo(bx + ax * x[k], by + ay * y[k]);
		else path.moveTo(bx + ax * x[k], by + ay * y[k]);
		isOpen = !Number.isNaN(y[k]);
	}
	return path;
}

/** Return the path of a time series; if it has many samples, only the extremes of each pixel column. */
export function seriesPath(u, { x, y }) {
	const from = Math.max(0, lowerBound(x, u.scales.x.min) - 1);
	const to = Math.min(x.length, lowerBound(x, u.scales.x.max) + 2);
	if (to - from <= 4 * u.bbox.width) return line(u, { x, y }, from, to);
	const [ax, bx] = scalesOf(u);
	const kept = { x: [], y: [] };
	for (let k = from; k < to;) {
		const column = Math.floor(bx + ax * x[k]);
		const end = lowerBound(x, (column + 1 - bx) / ax, k + 1, to);
		kept.y.push(y[k], ...(extent(y, k, end) ?? []), y[end - 1]);
		while (kept.x.length < kept.y.length) kept.x.push((column + 0.5 - bx) / ax);
		k = end;
	}
	return line(u, kept);
}

/** Return the samples of a loop: of many, only the segments that touch a new pixel. Yields between pieces. */
export function* thinned(one, range, part, width, height) {
	const [from, to] = samplesOf(one, part);
	if (to - from <= ALL_SAMPLES_MAX) return { x: one.x.slice(from, to), y: one.y.slice(from, to) };
	const kept = { x: [], y: [] };
	const seen = new Uint8Array(width * height);
	for (let k = from; k < to; k += PIECE_SAMPLES) {
		keepNew(kept, seen, one, Math.max(from, k - 1), Math.min(to, k + PIECE_SAMPLES), range, width);
		yield;
	}
	return kept;
}

/** Append the segments from sample `from` to `to` that touch a new pixel. */
function keepNew(kept, seen, { x, y }, from, to, range, width) {
	const height = seen.length / width;
	const [ax, ay] = [width / (range.x[1] - range.x[0]), height / (range.y[1] - range.y[0])];
	const [bx, by] = [-ax * range.x[0], -ay * range.y[0]];
	let [px, py, isOpen] = [NaN, NaN, false];
	for (let k = from; k < to; k += 1) {
		const dx = bx + ax * x[k] - px;
		const dy = by + ay * y[k] - py;
		const long = Math.max(Math.abs(dx), Math.abs(dy));
		const steps = long > STEP_MAX_PX ? Math.min(Math.ceil(long), 4 * width) : 1;
		let isNew = false;
		for (let s = 1; s <= steps; s += 1) {
			const [qx, qy] = [px + (dx * s) / steps, py + (dy * s) / steps];
			if (!(qx >= 0 && qy >= 0 && qx < width && qy < height)) continue; // NaN is outside.
			const pixel = (qy | 0) * width + (qx | 0);
			if (seen[pixel]) continue;
			seen[pixel] = 1;
			isNew = true;
		}
		if (isNew && !isOpen) {
			kept.x.push(NaN, x[k - 1]);
			kept.y.push(NaN, y[k - 1]);
		}
		if (isNew) {
			kept.x.push(x[k]);
			kept.y.push(y[k]);
		}
		isOpen = isNew;
		px = bx + ax * x[k];
		py = by + ay * y[k];
	}
}

/** Run a generator to its end without pauses; return its result. */
export function finished(work) {
	for (;;) {
		const { done, value } = work.next();
		if (done) return value;
	}
}

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

/** Return a new uPlot; `heard` contains the callbacks onRange(view) and onCursor(u). */
function* build(place, spec, colours, heard = {}) {
	const { x, y, height, span: part, isLoop } = spec;
	const unit = y.split(", ").at(-1);
	const nothing = { x: [], y: [], colour: () => colours.ink }; // uPlot needs a series.
	const data = spec.data.series.length ? spec.data : { ...spec.data, series: [nothing] };
	const range = rangesOf(data, spec);
	const width = Math.max(50, place.clientWidth);
	const size = [width, height].map((px) => Math.ceil(px * uPlot.pxRatio));
	const loops = new Map();
	for (const one of data.series)
		if (!isSeries(one)) loops.set(one, yield* thinned(one, range, part, ...size));
	const axis = {
		stroke: colours.soft,
		font: FONT,
		labelFont: FONT,
		labelSize: 18,
		grid: { stroke: colours.grid, width: 1 },
		ticks: { show: false },
		values: (_u, values) => values.map((one) => String(Number(one.toPrecision(6)))),
	};
	// The min width aligns the times of most plots.
	const widest = (_u, texts) => 14 + 7 * Math.max(6, ...(texts ?? []).map((text) => text.length));
	const path = (one) => (u) => {
		if (one.kind === "points" && !one.line) return null;
		const stroke = isSeries(one) ? seriesPath(u, one) : line(u, loops.get(one));
		return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
	};
	// A browser draws a long line of one pixel ten times as fast as a wider line.
	const isLong = (one) => {
		const [from, to] = isSeries(one)
			? range.x.map((end) => lowerBound(one.x, end))
			: samplesOf(one, part);
		return to - from > ALL_SAMPLES_MAX;
	};
	const curve = (one) => ({
		facets: ["x", "y"].map((scale) => ({ scale, auto: false })),
		auto: false,
		paths: path(one),
		points: { show: false },
		stroke: one.colour(colours),
		width: one.kind === "points" ? 1 : isLong(one) ? 1 / uPlot.pxRatio : (one.width ?? 1.4),
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
		width,
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
	return new uPlot(options, [null, ...data.series.map((one) => [one.x, one.y])], place);
}

/** Return a shared cursor: `point(t)` moves it to a time, null removes it; then `heard(t)` is called. */
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

const due = []; // queue of plots to be drawn, at most one per animation frame

function drawDue() {
	const end = performance.now() + FRAME_MS;
	let isDone = false;
	while (!isDone && due.length && performance.now() < end) isDone = due[0].next().done;
	if (isDone) due.shift();
	if (due.length) requestAnimationFrame(drawDue);
}

/**
 * Plot with title, toolbar and legend. Without `view` the plot stores its range; with `hidden` it draws no legend.
 *
 * `link`: shared cursor; `span`: time span of the loops; `fromZero`: the y axis contains zero.
 */
function Plot(props) {
	const { title, x, y, data, height = 300, isLoop = false, link } = props;
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
		function* draw() {
			const before = member.u;
			member.u = yield* build(box.current, spec, palette(), { onRange: setView, onCursor });
			before?.destroy();
			delete dataset.drawing;
		}
		dataset.drawing = "";
		const drawing = draw();
		due.push(drawing);
		if (due.length === 1) requestAnimationFrame(drawDue);
		return () => due.includes(drawing) && due.splice(due.indexOf(drawing), 1);
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
	const keys = "Arrow keys move, plus and minus zoom, 0 shows all.";
	const label = `${title}. ${y} over ${x}. ${keys}`;
	return figure.plot(
		div.head(
			figcaption(title),
			div.tools(
				button("Whole", () => setView(null)),
				button("PNG", () => savePng(spec)),
				button("CSV", () => saveCsv(spec)),
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

/** Return the ranges after a key press: null for the whole range, undefined for other keys. */
function moved({ x, y }, key) {
	const shift = { ArrowLeft: -0.1, ArrowRight: 0.1 }[key] * (x[1] - x[0]);
	if (shift) return { x: x.map((value) => value + shift), y };
	const factor = { "+": 0.8, "=": 0.8, "-": 1.25 }[key];
	const zoomed = ([low, high]) =>
		[-1, 1].map((side) => (low + high + side * factor * (high - low)) / 2);
	if (factor) return { x: zoomed(x), y: zoomed(y) };
	return key === "0" ? null : undefined;
}

function move({ u }, { series: [first] }, t) {
	if (!u || !first) return;
	const at = t !== null && first.t ? nearest(first.t, t) : null;
	const [x, y] = at === null ? [t, u.scales.y.min] : [first.x[at], first.y[at]];
	const isAway = t === null;
	const [left, top] = isAway ? [-10, -10] : [u.valToPos(x, "x"), u.valToPos(y, "y")];
	u.setCursor({ left, top }, false);
}

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

async function savePng(spec) {
	const place = document.createElement("div");
	place.className = "offscreen";
	document.body.append(place);
	const colours = palette(true);
	const u = finished(build(place, spec, colours));
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

/** Save the visible series inside the view as CSV, in two columns each. */
function saveCsv({ data: { series }, isLoop, view, span: part, x, y, name }) {
	const columns = series.flatMap((one) => {
		const isAll = isLoop || !view;
		const [from, to] = isAll ? samplesOf(one, part) : view.x.map((end) => lowerBound(one.x, end));
		return [one.x.slice(from, to), one.y.slice(from, to)];
	});
	const head = series.flatMap((one) => [x, `${one.name} (${y})`]);
	const length = Math.max(0, ...columns.map((values) => values.length));
	const rows = Array.from({ length }, (_, k) => columns.map((values) => values[k]));
	save(`${name}.csv`, new Blob(csvText([head, ...rows]), { type: "text/csv" }));
}

export const plot = (props) => h(Plot, props);
