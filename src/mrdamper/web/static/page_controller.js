// Controller: force tracking, and export of model and controller as code.

import { at } from "./api.js";
import { formOf } from "./forms.js";
import { jobColumns } from "./jobs.js";
import { empty, pageHead, tabbed } from "./layout.js";
import { createLink, nth, plot } from "./plot.js";
import { resultView } from "./results.js";
import { app, cardDetails, cardInUse, choose, chosen } from "./state.js";
import { fixed } from "./text.js";
import { button, field, select, tags } from "./ui.js";
import { h, useMemo } from "./vendor/preact.js";

const { div, p } = tags;
const SHOWN_S = 4; // initial time span of the plots
const missingNote = (words) => words && p.small({ id: "missing-controllers" }, words);

/** Return the default damper for tracking: the rig preset that made all runs of the card, else the card. */
function plantOf({ name }) {
	const rigOf = (source) => app.state.files.find((file) => file.name === source)?.rig;
	const [preset, ...others] = new Set((cardDetails(name)?.sources ?? []).map(rigOf));
	const isPreset = others.length === 0 && app.state.choices.plants.includes(preset);
	return isPreset ? preset : name;
}

function tracking(card) {
	const only = { controllers: card.controllers };
	const form = formOf("track", { only, preset: { plant: plantOf(card) } });
	const nothing = "Choose targets, temperatures and controllers, and press Track.";
	const view = (job) =>
		resultView(job, "track.tab", {
			own: exportButtons(job.answer, card),
			tabs: [["Plots", () => h(Traces, { answer: job.answer })]],
		});
	const options = { card: card.name, first: missingNote(card.missing), nothing, view };
	return jobColumns("track", "What to track", "Track", form, options);
}

function exportButtons({ worst }, { controllers }) {
	const groups = Map.groupBy(worst, ({ controller }) => controller);
	const error = (name) =>
		Math.max(...groups.get(name).map((row) => row.rmse_feasible_N ?? row.rmse_N));
	const names = [...groups.keys()].filter((name) => controllers.includes(name));
	const one = (name, k) => {
		const open = () => choose({ controller: name, "track.page": "Export" });
		return button(`Export ${name}`, open, k ? "" : "main");
	};
	return div.actions(names.sort((x, y) => error(x) - error(y)).map(one));
}

function Traces({ answer: { traces = [] } }) {
	const link = useMemo(() => createLink(), []);
	const trace = traces[chosen("track.trace", 0)] ?? traces[0];
	const data = useMemo(() => trace && curvesOf(trace), [trace]);
	if (!trace) return p.small("No curves.");
	const [begin, last] = [trace.time_s[0], trace.time_s.at(-1)];
	const end = Math.min(last, begin + SHOWN_S);
	const view = chosen("track.view", { x: [Math.min(begin + 1, end), end] });
	const onRange = (next) => choose({ "track.view": next ?? { x: [begin, last] } }, true);
	const pane = (title, unit, height) => {
		const word = title.toLowerCase();
		const axes = { x: "time, s", y: `${word}, ${unit}`, name: `tracking-${word}`, height };
		return plot({ title, ...axes, data: data[word], link, view, onRange });
	};
	const words = (one) => `${one.target} at ${fixed(one.temperature_degC, 0)} °C`;
	const options = traces.map((one, k) => [String(k), words(one)]);
	const take = (k) => choose({ "track.trace": Number(k), "track.view": null });
	return div(
		field("Trace", select(options, String(traces.indexOf(trace)), take, { id: "trace" })),
		pane("Force", "N", 270),
		pane("Error", "N", 150),
		pane("Current", "A", 150),
	);
}

function curvesOf({ time_s: x, wanted_N: wanted, low_N: low, high_N: high, runs }) {
	const lines = (values, width) =>
		runs.map((run, k) => ({ name: run.controller, x, y: values(run), colour: nth(k), width }));
	const out = { name: "target out of reach", colour: (colours) => colours.outside };
	const spans = [];
	wanted.forEach((value, k) => {
		if (value >= low[k] && value <= high[k]) return;
		if (spans.at(-1)?.k === k - 1) Object.assign(spans.at(-1), { to: x[k], k });
		else spans.push({ ...out, from: x[k], to: x[k], k });
	});
	const ink = { colour: (colours) => colours.ink, width: 1.6, dash: [6, 4] };
	const grey = (colours) => colours.measured;
	const bound = (y) => ({ name: "attainable force", x, y, width: 1, colour: grey });
	const error = (run) => run.force_N.map((value, k) => value - wanted[k]);
	const target = { name: "target", x, y: wanted, ...ink };
	return {
		force: { series: [bound(low), bound(high), target, ...lines((run) => run.force_N, 1.5)] },
		error: { series: lines(error, 1.2), spans },
		current: { series: lines((run) => run.command_A, 1.2), spans },
	};
}

function exporting({ controllers, name, missing }) {
	const preset = { ...(controllers.length ? {} : { content: "model" }), damper: null };
	const form = formOf("export", { only: { controller: controllers }, preset });
	const nothing =
		"Press Make and verify. The C code is compiled here and compared with the model, sample by sample.";
	const options = { card: name, first: missingNote(missing), nothing, view: exportView };
	return jobColumns("export", "What to export", "Make and verify", form, options);
}

function exportView(job) {
	const { fmu_platforms: folders } = job.answer;
	const only = (path) => (!path.includes("/") || path.endsWith(".md")) && path !== "job.json";
	const binaries = folders?.length
		? `The FMU runs on ${folders.join(", ")}.`
		: "The FMU has no binary.";
	const words = `${binaries} For other platforms it contains the C sources.`;
	const own = folders && p.small({ id: "platforms" }, words);
	return div({ id: "export-result" }, resultView(job, "export.tab", { own, only }));
}

export function ControllerPage() {
	const title = pageHead(
		"Controller",
		"Force control without a force sensor, and code for the target.",
	);
	const card = cardInUse();
	const words = "Controllers and code are made from a card. Fit a model first.";
	if (!card) return [title, empty(words, "model")];
	const tabs = [
		["Try", () => tracking(card)],
		["Export", () => exporting(card)],
	];
	return [title, tabbed("Try or export", "track.page", tabs)];
}
