// Jobs on a page: start, progress and end; files of jobs, and the trash.

import { at, get, post, put, remove } from "./api.js";
import { empty, note, tag } from "./layout.js";
import { app, attempt, choose, chosen, isRunning, once, refresh, toast } from "./state.js";
import { duration } from "./text.js";
import { button, tags } from "./ui.js";

const { b, div, form, p, progress } = tags;

/** Return the job in the address, else a running job, else the newest job with a result for the card. */
export function jobOf(kind, card = null) {
	const mine = app.state.jobs.filter((job) => job.kind === kind);
	const isResult = (job) =>
		(job.state === "done" || job.resumable) && (!card || job.options.card === card);
	const found =
		mine.find(({ id }) => id === chosen(`${kind}.job`)) ??
		mine.find(isRunning) ??
		mine.find(isResult);
	return found ?? null;
}

/** Return a job with its answer; null if the job has not ended. */
export function resultOf(job) {
	if (!job || isRunning(job)) return null;
	const found = once(`job ${job.id} ${job.ended_at}`, () => get(at`jobs/${job.id}`));
	return found?.answer ? found : null;
}

async function start(kind, read, started) {
	app.faults[kind] = null;
	try {
		const options = read();
		app.starting = kind;
		app.draw();
		const { id } = await post(at`jobs`, { kind, options });
		choose({ [`${kind}.job`]: id });
		started?.(options);
		await refresh(false);
	} catch (fault) {
		app.faults[kind] = fault.message;
	}
	app.starting = null;
	app.draw();
	document.querySelector(`[data-job=${kind}]`)?.scrollIntoView({ block: "nearest" });
}

export function startButton(kind, words, read, options = {}) {
	const { started, disabled, look = "main", ...props } = options;
	const isBusy = app.state.jobs.some((job) => job.kind === kind && isRunning(job));
	const isOff = disabled || isBusy || app.starting === kind;
	const about = { id: `start-${kind}`, disabled: isOff, ...props };
	return button(words, () => start(kind, read, started), look, about);
}

export const formPanel = (words, fields, start, ...first) =>
	form.panel(
		{ "aria-label": words, onsubmit: (event) => event.preventDefault() },
		first,
		fields.nodes(),
		fields.more(),
		div.actions(start),
	);

/** Return the form of a kind of job next to its job; `card`: only jobs of this card; `first`: above the form. */
export function jobColumns(kind, title, action, form, options) {
	const { card, read = form.read, first, nothing, view, ...props } = options;
	const job = jobOf(kind, card);
	const result = resultOf(job);
	return div.split(
		formPanel(title, form, startButton(kind, action, read, props), first),
		div(jobStatus(kind, job), result ? view(result) : !job && nothing && empty(nothing)),
	);
}

export function jobStatus(kind, job) {
	const fault = app.faults[kind];
	const state = job && (isRunning(job) ? atWork(job) : endOf(job));
	return div({ "data-job": kind }, fault && note("fault", fault), state);
}

function atWork(job) {
	const { done, of: all, text } = job.progress ?? {};
	const seconds = job.started_at ? (Date.now() - new Date(job.started_at)) / 1000 : null;
	const isWaiting = job.state === "queued";
	const value = all > 0 && job.kind !== "fit" ? done / all : undefined;
	return div.panel(
		div.row(b(job.id), tag("running", "at work"), cancelButton(job, "")),
		progress({ max: 1, "aria-label": "Progress", value }),
		p.small(
			isWaiting ? "Waiting for its turn …" : `${text ?? "Starting …"} · ${duration(seconds)}`,
		),
	);
}

export const cancelButton = ({ id }, look = "quiet", name = {}) =>
	button("Cancel", () => attempt(() => post(at`jobs/${id}/cancel`)), look, name);

export const resumeButton = ({ id, resumable }, look = "quiet") =>
	resumable &&
	button("Resume", () => attempt(() => post(at`jobs/${id}/resume`)), look, `Resume ${id}`);

function endOf(job) {
	if (job.state === "done") return null;
	const kind = job.state === "failed" ? "fault" : "warning";
	return note(kind, `${job.id} ${job.state}:\n${job.message} `, resumeButton(job, ""));
}

export async function keepInput(job, path, name) {
	const raw = await (await fetch(at`jobs/${job.id}/files/${path}`)).blob();
	await put(at`inputs/${name}`, { raw });
	toast("good", `${name} is saved with the inputs.`);
}

export const putBack = (id, name = {}) =>
	button("Put back", () => attempt(() => post(at`trash/${id}/restore`)), "quiet", name);

/** Return a button that moves an item into the trash. */
export function removal(kind, name, removed = () => {}) {
	const discard = async () => {
		const answer = await attempt(() => remove(at`${kind}/${name}`));
		if (!answer) return;
		removed();
		toast("info", `${name} was moved to the trash.`, putBack(answer.trash));
	};
	return button("Remove", discard, "quiet danger", `Remove ${name}`);
}
