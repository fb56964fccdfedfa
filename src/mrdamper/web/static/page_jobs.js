// Page Jobs: jobs with states and results, forms of other jobs, inputs, and trash.

import { at, get, remove } from "./api.js";
import { bringInput, fillForm, formOf } from "./forms.js";
import { cancelButton, formPanel, jobStatus, keepInput, putBack, removal } from "./jobs.js";
import { resultOf, resumeButton, startButton } from "./jobs.js";
import { empty, note, pageHead, table, tag, titled } from "./layout.js";
import { resultView } from "./results.js";
import { app, attempt, choose, chosen, go, isRunning, once } from "./state.js";
import { bytes, duration } from "./text.js";
import { button, field, opening, select, tags } from "./ui.js";

const { b, div, h2, p, span } = tags;
const PAGE_OF = {
	fit: ["model", {}],
	heat: ["thermal", { "heat.tab": "Heating" }],
	heatsink: ["thermal", { "heat.tab": "Heat sink" }],
	track: ["controller", { "track.page": "Try" }],
	export: ["controller", { "track.page": "Export" }],
};
/** Form titles of jobs that have no own page. */
const OTHERS = {
	evaluate: "Predict runs with a card",
	compare: "Compare two cards",
	check: "Check all runs",
	rig: "Runs of the virtual rig",
	fetch: "Public data of real dampers, from github.com",
	cycles: "Count the cycles of a long record",
	derate: "The largest current that keeps every limit",
	fluid: "Fit a fluid to rheometer tables",
	sweep: "Sweep: many fits, random dampers or heat sinks",
	demo: "Demonstration on the virtual rig",
};

function subjectOf({ options, card }) {
	const { first, second, record, campaign, name, tables } = options;
	const both = first && `${first}, ${second}`;
	const input = () => [campaign ?? tables ?? name ?? []].flat().join(", ");
	return options.card ?? card ?? record ?? both ?? input();
}

function open({ id, kind, options }) {
	if (!(kind in PAGE_OF))
		return choose({ "show.job": id, "show.kind": kind in OTHERS ? kind : null });
	const [page, tab] = PAGE_OF[kind];
	fillForm(kind, options);
	return go(page, { [`${kind}.job`]: id, card: options.card ?? null, ...tab });
}

function jobTable(jobs) {
	const took = ({ started_at: from, ended_at: to }) =>
		from && duration(((to ? new Date(to) : new Date()) - new Date(from)) / 1000);
	const when = ({ asked_at: asked }) =>
		new Date(asked).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
	const progress = ({ message, progress: now, state }) =>
		message ?? (state === "done" ? "" : (now?.text ?? ""));
	const actions = (job) => {
		const { id, kind, state } = job;
		if (isRunning(job)) return cancelButton(job, "quiet", `Cancel ${id}`);
		const isShown = state === "done" || (state === "cancelled" && kind === "fit");
		return span.row(
			isShown && button("Show", () => open(job), "quiet", `Show ${id}`),
			resumeButton(job),
			removal("jobs", id),
		);
	};
	const columns = [
		["job", ({ id }) => b(id), "whole"],
		["subject", subjectOf, "name"],
		["state", ({ state }) => tag(state)],
		["started", when, "whole"],
		["duration", took, "n"],
		["progress", progress, "name"],
		["", actions],
	];
	return table("Jobs, newest first", columns, jobs, { tall: true });
}

function shownJob(job) {
	const result = resultOf(job);
	const { title, runs, licence } = result?.answer ?? {};
	const use = () => attempt(() => keepInput(job, "fluid.toml", `${job.id}.toml`));
	return div(
		{ id: "job-result" },
		h2(`${job.id}: ${subjectOf(job)}`),
		jobStatus(job.kind, job),
		result &&
			resultView(result, "show.tab", {
				own: [
					title && note("good", `${title}: ${runs?.join(", ")}. Licence: ${licence}.`),
					job.kind === "fluid" && button("Use this fluid", use, "", `Use the fluid of ${job.id}`),
				],
			}),
	);
}

function otherJobs(jobs) {
	const kind = chosen("show.kind", "evaluate");
	const form = formOf(kind);
	const started = () => choose({ "show.job": app.choice[`${kind}.job`] });
	const set = (next) => choose({ "show.kind": next });
	const kinds = field("Job", select(Object.entries(OTHERS), kind, set, { id: "other-kind" }));
	const start = startButton(kind, "Start", form.read, { started });
	const shown = jobs.find(({ id }) => id === chosen("show.job"));
	const fault = !shown && app.faults[kind];
	return div(
		{ class: "split gap" },
		formPanel("Another job", form, start, kinds),
		div(shown && shownJob(shown), fault && note("fault", fault)),
	);
}

function inputTable() {
	const { inputs } = app.state;
	const columns = [
		["input", ({ name }) => opening(at`inputs/${name}`, name), "name"],
		["kind", ({ kind }) => kind],
		["size", ({ bytes: size }) => bytes(size), "n"],
		["", ({ name }) => removal("inputs", name)],
	];
	return titled(
		"Inputs",
		p.small(
			"Geometry, fluids, scenarios and campaigns (TOML), load cycles and rheometer tables (CSV).",
		),
		inputs.length > 0 && table("Inputs in the folder", columns, inputs),
		bringInput("Bring an input", ".toml,.csv"),
	);
}

function trashTable() {
	const { files, jobs, inputs, cards } = app.state;
	const names = [files, jobs, inputs, cards].flat().map(({ id, name }) => id ?? name);
	const { trash = [] } = once(`trash ${app.emptied} ${names}`, () => get(at`trash`)) ?? {};
	if (!trash.length) return null;
	const clear = async () => {
		if (!window.confirm("Delete all items in the trash permanently?")) return;
		await attempt(() => remove(at`trash`));
		app.emptied = Date.now();
		app.draw();
	};
	const columns = [
		["removed", (one) => one.names.join(", "), "name"],
		["", ({ id, names: [name] }) => putBack(id, `Put back ${name}`), "whole"],
	];
	return titled(
		"Trash",
		table("Trash, newest first", columns, trash),
		div.actions(button("Empty the trash", clear, "danger")),
	);
}

export function JobsPage() {
	const { jobs } = app.state;
	return [
		pageHead("Jobs", "Two jobs run at a time. Their results are files in the folder."),
		jobs.length ? jobTable(jobs) : empty("No jobs yet.", "data"),
		otherJobs(jobs),
		inputTable(),
		trashTable(),
	];
}
