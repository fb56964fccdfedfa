// Linked view: forces of runs and cards as loops and versus time, with one cursor and one time span.
//
// Choices: `t` (time span), `d` and `v` (ranges of the loops), `hide`, `centre`, `cycles`. Each zoom is a step of the
// browser's history, so that Back undoes it.

import { samples } from "./api.js";
import { note, table } from "./layout.js";
import { createLink, extent, legendOf, nearest, nth, plot } from "./plot.js";
import { commandOf, temperatureOf } from "./runs.js";
import { app, cardDetails, choose, chosen } from "./state.js";
import { rampColour } from "./theme.js";
import { counted, fixed, has, several, toggled } from "./text.js";
import { button, tags } from "./ui.js";
import { h, useEffect, useMemo, useState } from "./vendor/preact.js";

const { div, p } = tags;

const LOOPS = ["d", "v"];
/** Plots by key: columns of x and y, and height. */
const PANES = {
	d: ["displacement_mm", "force_N", 290],
	v: ["velocity_mm_s", "force_N", 290],
	f: ["time_s", "force_N", 160],
	r: ["time_s", "residual_N", 130],
	x: ["time_s", "displacement_mm", 110],
	A: ["time_s", "command_A", 100],
	V: ["time_s", "command_V", 100],
	T: ["time_s", "temperature_degC", 100],
};
const MODELLED = "dvfr"; // keys of the plots that also show the forces of cards
/** Columns: word, unit, and decimals at the cursor. */
const QUANTITIES = {
	time_s: ["time", "s"],
	force_N: ["force", "N", 0],
	residual_N: ["residual", "N", 0],
	displacement_mm: ["displacement", "mm", 2],
	velocity_mm_s: ["velocity", "mm/s", 1],
	command_A: ["current", "A", 2],
	command_V: ["voltage", "V", 2],
	temperature_degC: ["temperature", "°C", 1],
};
const SAMPLES_MAX = 2_200_000; // max number of samples in all curves together
const CURSOR_ROWS_MAX = 8;

/** Return how a fit used the runs, by name: `training` or `held_out`. */
export const splitsOf = (name) =>
	new Map((cardDetails(name)?.evidence?.runs ?? []).map((run) => [run.name, run.split]));

/** Return the runs of the motion with the most constant-command runs, at the lowest temperature. */
export function usualRuns(runs) {
	const counts = Map.groupBy(runs, ({ motion }) => motion);
	const constant = ([, group]) => group.filter(({ command }) => has(command)).length;
	const [[, similar] = [null, []]] = [...counts].sort((x, y) => constant(y) - constant(x));
	const coldest = Math.min(...similar.map((run) => run.temperature_degC ?? Infinity));
	return similar.filter((run) => coldest === Infinity || run.temperature_degC < coldest + 5);
}

async function fetchOne(run, card, limits) {
	const failed = (fault) => {
		if (fault.name === "AbortError") throw fault;
		return { fault: fault.message, columns: {} };
	};
	const answer = await samples(run, card, limits).catch(failed);
	const { force_N: force, measured_N: measured } = answer.columns;
	if (measured) answer.columns.residual_N = force.map((value, k) => value - measured[k]);
	return { run, card, ...answer };
}

/** Fetch samples of runs and forces of cards: `{shown, ms}`; `shown` is null during a request. */
function useSamples(picked, cards, part) {
	const [found, set] = useState({ shown: null });
	const fraction = SAMPLES_MAX / Math.max(1, picked.length * (1 + cards.length));
	const isThinned = picked.some((run) => run.samples > fraction);
	const limits = isThinned ? { max: 2 ** Math.floor(Math.log2(Math.max(64, fraction))) } : {};
	if (isThinned && part) [limits.from_s, limits.to_s] = part;
	const wanted = picked.flatMap((run) => [null, ...cards].map((card) => [run, card]));
	const versions = app.state.cards.filter(({ name }) => cards.includes(name));
	const key = [wanted.map(([run, card]) => [run.file, run.name, card]), versions, limits];
	useEffect(() => {
		const asked = new AbortController();
		const began = performance.now();
		const all = wanted.map(([run, card]) =>
			fetchOne(run, card, { ...limits, signal: asked.signal }),
		);
		set({ shown: null });
		Promise.all(all).then(
			(shown) => set({ shown, ms: Math.round(performance.now() - began) }),
			() => {}, // This happens only if the request was aborted.
		);
		return () => asked.abort();
	}, [JSON.stringify(key)]);
	return found;
}

/** Return the last complete cycles, with centred displacement, if the user chose this. */
function prepared(columns, count, isCentred) {
	const { displacement_mm: x } = columns;
	if (!x || (!count && !isCentred)) return columns;
	const middle = extent(x).reduce((low, high) => (low + high) / 2);
	const rises = [];
	if (count)
		for (let k = 1; k < x.length; k += 1) if (x[k - 1] < middle && x[k] >= middle) rises.push(k);
	const isCut = rises.length > count && count;
	const [from, to] = isCut ? [rises.at(-1 - count), rises.at(-1) + 1] : [0, x.length];
	const all = Object.entries(columns).map(([name, values]) => [name, values?.subarray(from, to)]);
	const cut = Object.fromEntries(all);
	if (isCentred) cut.displacement_mm = cut.displacement_mm.map((value) => value - middle);
	return cut;
}

/** Return the property that colours the runs: `command`, else `temperature_degC`, else `name`. */
function differenceOf(runs) {
	const differ = (property) => new Set(runs.map(property)).size > 1;
	if (differ((run) => run.command_unit)) return "name";
	return (
		(differ(commandOf) && "command") || (differ(temperatureOf) && "temperature_degC") || "name"
	);
}

/** Return key and colour of a run by its command, temperature or name. */
function colourOf(run, by, runs) {
	const isRun = ({ file, name }) => file === run.file && name === run.name; // A refresh renews `runs`.
	if (by === "name") return { key: run.name, colour: nth(runs.findIndex(isRun)) };
	const key = by === "command" ? commandOf(run) : temperatureOf(run);
	const range = extent(runs.map((one) => one[by]).filter(has));
	if (!has(run[by]) || !range) return { key, colour: nth(3) };
	const fraction = (run[by] - range[0]) / (range[1] - range[0] || 1);
	return { key, colour: (colours) => rampColour(fraction, colours) };
}

/** Return the curves of samples. Measured curves are grey and wide, below the modelled curves. */
function curvesOf(shown, { runs, cards, by, cycles, isCentred }) {
	const drawn = [...new Set(shown.map(({ run }) => run))];
	const isHeld = (run) => cards.some((card) => splitsOf(card).get(run.name) === "held_out");
	const words = (run) => `${commandOf(run)}, ${temperatureOf(run)}`.replace(", unknown", "");
	const isUnique = (run) => drawn.filter((other) => words(other) === words(run)).length === 1;
	const curve = (one) => {
		const { run, card } = one;
		const columns = prepared(one.columns, cycles, isCentred);
		const ofCard = { key: card, colour: nth(cards.indexOf(card)) };
		const look = by === "card" && card ? ofCard : colourOf(run, by, runs);
		const name = (isUnique(run) ? words(run) : run.name) + (isHeld(run) ? ", held out" : "");
		const base = { ...one, columns, name, width: 1.3, isHeld: isHeld(run), ...look };
		if (!cards.length) return base;
		if (!card) {
			const measured = { key: "measured", colour: (colours) => colours.measured, width: 2.4 };
			return { ...base, name: `${name}, measured`, ...measured };
		}
		return { ...base, name: `${name}, ${card}` };
	};
	return shown.filter(({ head }) => head).map(curve);
}

function paneOf(id, curves) {
	const [x, y, height] = PANES[id];
	const isLoop = LOOPS.includes(id);
	const isDrawn = ({ columns, card }) =>
		columns[x] && columns[y] && (!card || MODELLED.includes(id));
	const series = curves.filter(isDrawn).map(({ columns, head, ...one }) => {
		const samplesOf = { ...one, x: columns[x], y: columns[y] };
		if (isLoop) return { ...samplesOf, kind: "loop", t: columns.time_s };
		return { ...samplesOf, since: id === "r" ? (head.scored_from_s ?? 0) : 0 };
	});
	const start = Math.max(0, ...series.map(({ since }) => since ?? 0));
	const band = { from: 0, to: start, name: "start, not scored", colour: (colours) => colours.band };
	const label = (name) => QUANTITIES[name].slice(0, 2).join(", ");
	const word = QUANTITIES[isLoop ? x : y][0];
	const title = `${word[0].toUpperCase()}${word.slice(1)} ${isLoop ? "loops" : "over time"}`;
	const axes = { x: label(x), y: label(y), height, isLoop, fromZero: y.startsWith("command") };
	const name = title.toLowerCase().replaceAll(" ", "-");
	return { id, title, name, ...axes, data: { series, spans: start > 0 ? [band] : [] } };
}

/** Linked view: all `runs` determine the colours, the `picked` ones are drawn; `panes`: keys of the plots. */
function LinkedView({ runs, picked, cards, prefix, panes = "dvfrxAVT" }) {
	const [t, point] = useState(null);
	const link = useMemo(() => createLink(point), []);
	const get = (name, otherwise = null) => chosen(`${prefix}.${name}`, otherwise);
	const set = (values) => {
		const entries = Object.entries(values).map(([name, value]) => [`${prefix}.${name}`, value]);
		choose(Object.fromEntries(entries), true);
	};
	const part = get("t");
	const { shown, ms } = useSamples(picked, cards, part);
	const by = cards.length > 1 ? "card" : differenceOf(picked);
	const how = { by, cycles: Number(get("cycles", 0)), isCentred: get("centre", false) };
	const splits = cards.map((card) => splitsOf(card).size);
	const drawn = useMemo(() => {
		const curves = curvesOf(shown ?? [], { runs, cards, ...how });
		return { curves, panes: [...panes].map((id) => paneOf(id, curves)) };
	}, [shown, JSON.stringify([how, splits])]);
	const hide = get("hide", []);
	const draw = ({ id, ...pane }) => {
		const range = pane.isLoop ? get(id) : part;
		const view = range && { x: range.slice(0, 2), y: pane.isLoop ? range.slice(2) : null };
		const onRange = (next) =>
			set(pane.isLoop ? { [id]: next && [...next.x, ...next.y] } : { t: next && next.x });
		return plot({ ...pane, key: id, view, onRange, span: part, hidden: hide, link });
	};
	const visible = drawn.panes.filter(({ data }) => data.series.length);
	const loops = visible.filter(({ isLoop }) => isLoop);
	const count = (shown ?? []).reduce((sum, { head }) => sum + (head?.n ?? 0), 0);
	const faults = [...new Set((shown ?? []).map(({ fault }) => fault).filter(Boolean))];
	const drawnWords = `${several(picked.length, "run")}, ${counted(count)} samples drawn.`;
	const words = shown ? drawnWords : "Fetching …";
	const status = shown ? { "data-ms": ms, "data-samples": count } : {};
	const press = ({ ctrlKey, metaKey, key }) => {
		if ((ctrlKey || metaKey) && key === "z") window.history.back();
		if ((ctrlKey || metaKey) && key === "y") window.history.forward();
	};
	const undo = { disabled: !window.history.state?.depth, title: "Ctrl+Z, or the browser's Back" };
	return div.linked(
		{ onkeydown: press },
		div.row(
			button("Undo zoom", () => window.history.back(), "", undo),
			button("Whole", () => set({ t: null, d: null, v: null }), "", { title: "All of every plot" }),
			p.small({ "aria-live": "polite", id: "view-status", ...status }, words),
		),
		faults.slice(0, 2).map((fault) => note("warning", fault)),
		legendOf(drawn.panes[0].data, hide, (key) => set({ hide: toggled(hide, key) })),
		div.pair(loops.map(draw)),
		visible.filter((pane) => !loops.includes(pane)).map(draw),
		drawn.curves.length > 0 && readout(drawn.curves, hide, t),
	);
}

function readout(all, hide, t) {
	const curves = all.filter(({ key }) => !hide.includes(key)).slice(0, CURSOR_ROWS_MAX);
	const known = Object.entries(QUANTITIES).filter(
		([name, [, , digits]]) => has(digits) && curves.some(({ columns }) => columns[name]),
	);
	const columnOf = ([name, [word, unit, digits]]) => {
		const value = ({ columns }) =>
			t !== null && columns[name] ? fixed(columns[name][nearest(columns.time_s, t)], digits) : "";
		return [word, value, "n", unit];
	};
	const title = t === null ? "point at a plot over time" : `${t.toFixed(3)} s`;
	const first = [title, ({ name }) => name, "name"];
	const error = ({ head }) => fixed(head.nrmse_percent, 2);
	const hasCard = curves.some(({ card }) => card);
	const last = hasCard && ["error of the run", error, "n", "% of spread"];
	const columns = [first, ...known.map(columnOf), last].filter(Boolean);
	const rowClass = ({ isHeld }) => (isHeld ? "held" : "");
	return div["readout-table"](table("Values at the cursor", columns, curves, { rowClass }));
}

export function characteristics(picked) {
	const runs = picked.toSorted((x, y) => x.command - y.command);
	const show =
		(name, digits, scale = 1) =>
		({ cycle }) =>
			cycle && fixed(scale * cycle[name], digits);
	const columns = [
		["run", ({ name }) => name, "name"],
		["command", commandOf, "whole"],
		["peak speed", (run) => fixed(run.peak_velocity_mm_s, 0), "n", "mm/s"],
		["highest force", show("highest_force_N", 0), "n", "N"],
		["lowest force", show("lowest_force_N", 0), "n", "N"],
		["energy per cycle", show("energy_J", 2), "n", "J"],
		["equivalent damping", show("damping_Ns_m", 2, 1e-3), "n", "kN s/m"],
	];
	return table("Characteristic of the last complete cycle", columns, runs);
}

export const linkedView = (props) => h(LinkedView, props);
