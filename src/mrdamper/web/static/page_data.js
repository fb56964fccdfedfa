// Page Data: files, channel maps, runs with findings, and linked plots.

import { at, get, put } from "./api.js";
import { ChannelSheet } from "./channels.js";
import { jobOf, jobStatus, removal, startButton } from "./jobs.js";
import { empty, note, pageHead, tabbed, table, tag } from "./layout.js";
import { findingList } from "./results.js";
import { commandOf, filtersOf, findingsBetween, idOf, matching, runList } from "./runs.js";
import { address, app, attempt, cards, choose, chosen, go } from "./state.js";
import { bytes, counted, fixed, has, number, several, toggled } from "./text.js";
import { button, check, choice, filePicker, tags } from "./ui.js";
import { characteristics, linkedView, splitsOf, usualRuns } from "./view.js";
import { h } from "./vendor/preact.js";

const { a, aside, div, h3, p, span } = tags;

/** Return the default runs: runs of the fit of the shown card, or else runs with its command unit. */
function firstRuns(runs) {
	const [name] = chosen("view.cards", []);
	const fitted = name ? splitsOf(name) : new Map();
	const unit = cards().find((card) => card.name === name)?.command_unit;
	const groups = [(run) => fitted.has(run.name), (run) => run.command_unit === unit, () => true];
	return usualRuns(groups.map((isIn) => runs.filter(isIn)).find((found) => found.length) ?? []);
}

export function DataPage() {
	const runs = app.runs.filter((run) => !run.error);
	const ids = chosen("view.runs") ?? firstRuns(runs).map((run) => idOf(run, runs));
	const runOf = (id) => runs.find((run) => idOf(run, runs) === id || run.name === id);
	const picked = ids.map(runOf).filter(Boolean);
	const missing = ids.filter((id) => !runOf(id));
	const isCard = (name) => cards().some((card) => card.name === name);
	const drawn = chosen("view.cards", []).filter(isCard);
	const { files, unnamed } = app.state;
	const file = files.find(({ name }) => name === chosen("file"));
	const others = files.map(({ name }) => name).filter((name) => name !== file?.name);
	const close = () => choose({ file: null });
	const rename = "Names that are not UTF-8 cannot be shown; rename in the folder:";
	return [
		pageHead("Data", "Measured runs of your damper, their channel maps and plots."),
		unnamed.length > 0 && note("warning", `${rename} ${unnamed.join(", ")}`),
		div.split(
			aside.panel(
				{ "aria-label": "Files, runs and cards" },
				dropZone(),
				runs.length > 0 && choices(runs, ids, drawn),
				[
					["rig", "Runs of the virtual rig"],
					["fetch", "Public data of real dampers"],
				].map(([kind, words]) =>
					p.small(a({ href: address("jobs", { "show.kind": kind }) }, words)),
				),
			),
			div(
				jobStatus("rig", jobOf("rig")),
				missing.length > 0 && note("warning", `Not in the folder: ${missing.join(", ")}`),
				app.reading > 0 && p.small(`Reading ${several(app.reading, "file")} …`),
				file
					? h(ChannelSheet, { key: file.name, name: file.name, others, close })
					: overview(runs, picked, drawn),
			),
		),
	];
}

function dropZone() {
	const over = (event) => {
		const isOver = event.type !== "dragleave" && event.type !== "drop";
		event.currentTarget.classList.toggle("over", isOver);
	};
	const drop = (event) => {
		event.preventDefault();
		over(event);
		upload([...event.dataTransfer.files]);
	};
	const { formats, most_upload_bytes: most } = app.state;
	const title = `${formats.join(" ")}, up to ${bytes(most)} each`;
	const props = { multiple: true, id: "picker" };
	return div.drop(
		{ id: "drop", ondragenter: over, ondragover: over, ondragleave: over, ondrop: drop, title },
		filePicker("Choose files", formats.join(","), upload, "main", props),
		" or drop them here",
		app.upload && p.small(app.upload),
	);
}

async function upload(files) {
	const most = app.state.most_upload_bytes;
	const remedy = `at most ${bytes(most)} can be sent. Copy it into the folder runs/ instead.`;
	for (const file of files) {
		app.upload = `${file.name}: sending ${bytes(file.size)} …`;
		app.draw();
		await attempt(() => {
			if (file.size > most) throw new Error(`${file.name} has ${bytes(file.size)}; ${remedy}`);
			return put(at`files/${file.name}`, { raw: file });
		});
	}
	app.upload = "";
	app.draw();
	if (files.length === 1) {
		const [{ name }] = files;
		const { error } = await get(at`files/${name}/look`).catch(() => ({}));
		if (error) choose({ file: name });
	}
}

function choices(runs, ids, drawn) {
	const found = matching(runs, "list");
	const whole = { "view.t": null, "view.d": null, "view.v": null };
	const take = (next) => choose({ "view.runs": next, ...whole }, true);
	const set = (name) => (value) => choose({ [`view.${name}`]: value || null }, true);
	const box = ({ name }) =>
		check(name, drawn.includes(name), () => set("cards")(toggled(drawn, name)));
	const cycles = ["", "1", "3"].map((count) => [count, count ? `last ${count}` : "all"]);
	return [
		filtersOf(runs, "list"),
		runList("Runs drawn", found, runs, ids, take),
		div(
			{ class: "row gap" },
			button(`Take these ${found.length}`, () => take(found.map((run) => idOf(run, runs)))),
			button("None", () => take([])),
		),
		cards().length > 0 && [
			h3.gap("Cards"),
			div.picks({ role: "group", "aria-label": "Cards drawn" }, cards().map(box)),
		],
		choice("Cycles", "view.cycles", cycles, true),
		check("centre the displacement", chosen("view.centre", false), set("centre")),
	];
}

function overview(runs, picked, drawn) {
	const { files } = app.state;
	const campaign = () => ({ campaign: "short" });
	const rig = () => startButton("rig", "Make runs on the virtual rig", campaign, { id: "virtual" });
	if (!files.length) {
		const words =
			"No runs yet. A run is one test: time, displacement, force, and current and temperature if known. " +
			"Drop files at the left, or start with a short campaign of the virtual rig.";
		return div(empty(words), rig());
	}
	const all = app.runs;
	const plots = () => linkedView({ runs, picked, cards: drawn, prefix: "view" });
	const fileTab = ["Files", () => fileTable(files)];
	const isMapNeeded = !runs.length || files.some(({ state }) => state === "unreadable");
	const tabs = [
		isMapNeeded && fileTab,
		runs.length > 0 && ["Plots", plots],
		!isMapNeeded && fileTab,
		all.length > 0 && ["Runs", () => runTable(matching(all, "list"), all)],
		picked.length > 0 && ["Characteristic", () => characteristics(picked)],
		all.length > 0 && ["Findings", () => checked(all)],
	];
	const fit = () => button("Fit a model", () => go("model"), "main");
	return [tabbed("Parts of the data", "view.tab", tabs), runs.length > 0 && div.actions(fit())];
}

function checked(runs) {
	const all = [...findingsBetween(runs), ...runs.flatMap((run) => run.findings ?? [])];
	const findings = all.filter(({ severity }) => severity !== "note");
	const report = a({ href: address("jobs", { "show.kind": "check" }) }, "Check with a report");
	const words = "No warnings and no faults were found so far.";
	return [findings.length ? findingList(findings) : p.small(words), p.small(report)];
}

function fileTable(files) {
	const state = ({ name, state: kind }) => {
		const own = app.runs.filter((run) => run.file === name);
		const isUseless = own.length > 0 && own.every((run) => run.error);
		return isUseless
			? tag("fault", "not usable")
			: tag(kind, kind === "unreadable" ? "not understood" : kind);
	};
	const open = (name) => () => choose({ file: name });
	const actions = ({ name, state: kind }) => {
		const words = kind === "unreadable" ? "Map channels" : "Look";
		const look = button(words, open(name), "quiet", `Look into ${name}`);
		return span.row(look, removal("files", name));
	};
	const columns = [
		["file", ({ name }) => button(name, open(name), "quiet"), "name"],
		["state", state, "whole"],
		["runs", (file) => file.state === "ready" && file.runs.length, "n"],
		["remarks", ({ error, mapped }) => error ?? (mapped ? "channels mapped by hand" : ""), "name"],
		["size", ({ bytes: size }) => bytes(size), "n"],
		["", actions, "whole"],
	];
	return table("Files in the folder", columns, files, { tall: true });
}

function runTable(shown, all) {
	const range = (pair, digits) => pair && `${fixed(pair[0], digits)} to ${fixed(pair[1], digits)}`;
	const temperature = ({ temperature_range_degC: pair, temperature_degC: mean }) =>
		pair && pair[1] - pair[0] > 2 ? range(pair, 0) : fixed(mean, 0);
	const command = (run) =>
		has(run.command) || !run.command_range
			? commandOf(run)
			: `${range(run.command_range, 2)} ${run.command_unit}`;
	const marks = (run) => [
		run.error && tag("fault", "not usable", run.error),
		!run.error && run.worst && tag(run.worst),
		run.copy_of && tag("warning", "copy", `a copy of ${run.copy_of}`),
		run.foreign && tag("warning", "other damper?", run.foreign),
	];
	const state = (run) => {
		const found = marks(run).filter(Boolean);
		if (found.length) return span.row(found);
		return run.checked ? tag("ok", "no findings") : tag("running", "being checked");
	};
	const link = (run) =>
		a({ href: address("data", { "view.runs": [idOf(run, all)] }), title: run.file }, run.name);
	const columns = [
		["run", link, "name"],
		["findings", state],
		["motion", (run) => run.motion, "whole"],
		["command", command, "n"],
		["temperature", temperature, "n", "°C"],
		["samples", (run) => run.samples && counted(run.samples), "n"],
		["rate", (run) => number(run.rate_Hz, 4), "n", "Hz"],
		["stroke", (run) => number(run.stroke_mm), "n", "mm"],
		["speed", (run) => number(run.peak_velocity_mm_s), "n", "mm/s"],
		["force", (run) => range(run.force_range_N, 0), "n", "N"],
	];
	const remark = shown.length < all.length && `${shown.length} of ${several(all.length, "run")}`;
	return table("Runs", columns, shown, { note: remark, tall: true });
}
