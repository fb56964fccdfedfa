// Page Model: choice of law and held-out runs, result of a fit, and table of fits.

import { at, get, put } from "./api.js";
import { fillForm, formOf, literal } from "./forms.js";
import { jobColumns, removal } from "./jobs.js";
import { keptFold, pageHead, table, tag, titled } from "./layout.js";
import { resultView } from "./results.js";
import { commonest, filtersOf, idOf, matching, runList } from "./runs.js";
import { address, app, attempt, choose, chosen, go, toast } from "./state.js";
import { fixed, number, several, toggled } from "./text.js";
import { button, filePicker, opening, tags } from "./ui.js";
import { linkedView } from "./view.js";

const { a, b, div, h2, p, span } = tags;
const RUNS_MAX = 3; // max number of runs in the plotted loops of a fit
const NAME = /[/\\:*?"<>|\p{C}]+/gu;

const cardName = (text) => text.replace(NAME, "-");

function freeName() {
	const isTaken = (name) => app.state.cards.some((card) => card.name === name);
	let name = "damper";
	for (let k = 2; isTaken(name); k += 1) name = `damper-${k}`;
	return name;
}

/** Return the runs that match the filters, have the same command unit, and are not excluded. */
function fittedRuns(runs, without) {
	const usual = commonest(runs.map((run) => run.command_unit).filter(Boolean));
	const isUsual = (run) => chosen("choose.unit") || !usual || run.command_unit === usual;
	const isChosen = (run) => isUsual(run) && !without.includes(idOf(run, runs));
	return matching(runs, "choose").filter(isChosen);
}

function runChoice(runs, fitted, without) {
	const found = matching(runs, "choose");
	const countOf = (mark, one, many) => {
		const count = found.filter((run) => run[mark]).length;
		return count ? `; ${count} ${count === 1 ? `is ${one}` : `are ${many}`}` : "";
	};
	const marks = ({ copy_of: original, foreign, worst }) =>
		[original && `a copy of ${original}`, foreign, worst === "fault" && "with a fault"].filter(
			Boolean,
		);
	const ids = fitted.map((run) => idOf(run, runs));
	const change = (next) => {
		const [one] = [...ids, ...next].filter((id) => ids.includes(id) !== next.includes(id));
		choose({ "choose.without": toggled(without, one) });
	};
	const another = "probably of another damper";
	const counts = countOf("copy_of", "a copy", "copies") + countOf("foreign", another, another);
	const words = `${ids.length} of ${several(runs.length, "run")}${counts}`;
	const list = () => runList("Fitted runs", found, runs, ids, change, marks);
	return div(filtersOf(runs, "choose"), keptFold("choose.open", "chosen-runs", words, list));
}

function runOptions(runs, fitted) {
	if (fitted.length === runs.length) return { files: null, only: [] };
	const files = [...new Set(fitted.map((run) => run.file))];
	const isWhole = runs.every((run) => fitted.includes(run) || !files.includes(run.file));
	return { files, only: isWhole ? [] : fitted.map((run) => literal(run.name)) };
}

/** Fill the form with the options of an earlier fit. */
async function again(card, job, runs) {
	const { options } = await get(at`jobs/${job.id}`); // Only the record of a single job contains the file names.
	const isWanted = ({ file, name }) =>
		(!options.files || options.files.includes(file)) &&
		(!options.only?.length || options.only.includes(literal(name)));
	const without = runs.filter((run) => !isWanted(run)).map((run) => idOf(run, runs));
	const keys = Object.keys(app.choice).filter((key) => key.startsWith("choose."));
	const cleared = Object.fromEntries(keys.map((key) => [key, null]));
	const given = { ...options, card: null, replace: false };
	fillForm("fit", given, { ...cleared, "choose.without": without });
	window.scrollTo(0, 0);
	toast("info", `The form shows the options of ${card.name}.`);
}

function fitView(job, runs) {
	const { answer, options } = job;
	const { card } = options;
	const isHeld = ({ split }) => split === "held_out";
	const isWorse = (x, y) => isHeld(y) - isHeld(x) || y.nrmse_percent - x.nrmse_percent;
	const worst = [...answer.runs].sort(isWorse);
	const found = worst.map(({ name }) => runs.find((run) => run.name === name)).filter(Boolean);
	const picked = found.filter((run) => run.motion === found[0].motion).slice(0, RUNS_MAX);
	const link = (...names) => address("data", { "view.runs": names, "view.cards": [card] });
	const loops = () => linkedView({ runs, picked, cards: [card], prefix: "loops", panes: "dvfr" });
	const sentence = answer.identifiability?.sentence;
	const own = [
		div.actions(
			button("How hot does it get?", () => go("thermal", { card }), "main"),
			button("Control it", () => go("controller", { card })),
			opening(at`cards/${card}/files/report.html`, "Open the report", { class: "button" }),
			a.button({ href: link(...picked.map((run) => idOf(run, runs))) }, "All plots"),
		),
		sentence && p.small(sentence),
	];
	const only = () => false;
	return [
		h2(`${card}: ${answer.law}`),
		resultView(job, "loops.tab", { own, tabs: [["Loops", loops]], link, only }),
	];
}

const range = (pair, unit) =>
	pair ? `${number(pair[0])} to ${number(pair[1])} ${unit ?? ""}` : "";

function stateOf({ cancelled, converged }) {
	if (cancelled || converged === false)
		return tag("warning", cancelled ? "cancelled" : "not converged");
	return converged && "yes";
}

function fitTable(runs) {
	const all = app.state.cards.toSorted((x, y) => String(y.modified).localeCompare(x.modified));
	const bring = ([file]) =>
		attempt(() => put(at`cards/${cardName(file.name.replace(/\.json$/i, ""))}`, { raw: file }));
	const jobOfCard = ({ name }) =>
		app.state.jobs.find((job) => job.kind === "fit" && job.options.card === name);
	const link = (card) => {
		const job = jobOfCard(card);
		const result = () => address("model", { "fit.job": job.id, card: card.name });
		const href = job ? result() : address("data", { "view.cards": [card.name] });
		const name = a({ href, title: job ? "Its result" : "Its loops" }, b(card.name));
		return [name, card.error && span.small(` ${card.error}`)];
	};
	const actions = (card) => {
		const [{ name }, job] = [card, jobOfCard(card)];
		const repeat = () => attempt(() => again(card, job, runs));
		const report = { "aria-label": `Report of ${name}` };
		return span.row(
			card.report && opening(at`cards/${name}/files/report.html`, "report", report),
			a({ href: at`cards/${name}`, download: `${name}.json` }, "card"),
			job && button("Again", repeat, "quiet", `Again with the options of ${name}`),
			removal("cards", name),
		);
	};
	const columns = [
		["fit", link, "name"],
		["law", ({ law }) => law, "whole"],
		["runs", (card) => card.runs, "n"],
		["cost", ({ cost_percent: cost }) => fixed(cost, 2), "n", "%"],
		["converged", stateOf, "whole"],
		["held out", ({ held_out_percent: held }) => fixed(held, 2), "n", "%, median"],
		["command", (card) => range(card.envelope?.command, card.command_unit), "whole"],
		["temperature", (card) => range(card.envelope?.temperature_degC, "°C"), "whole"],
		["date", ({ modified }) => String(modified).slice(0, 16).replace("T", " "), "whole"],
		["", actions, "whole"],
	];
	const list = table("Fits", columns, all);
	const nothing = p.small("No card yet: identify one, or bring a card.json.");
	return div(
		{ id: "fits" },
		titled("Fits", all.length ? list : nothing, filePicker("Bring a card", ".json", bring, "")),
	);
}

export function ModelPage() {
	const runs = app.runs.filter((run) => !run.error);
	const copies = runs.filter((run) => run.copy_of).map((run) => idOf(run, runs));
	const without = chosen("choose.without", copies);
	const fitted = fittedRuns(runs, without);
	const form = formOf("fit", {
		given: { files: null, only: [] },
		offered: { runs: fitted.map(({ name }) => name) },
		preset: { card: freeName() },
	});
	const read = () => {
		const options = form.read();
		return { ...options, card: cardName(options.card ?? freeName()), ...runOptions(runs, fitted) };
	};
	const ready = `${several(runs.length, "run")} can be fitted. Hold out one or two runs, and press Identify. The fit takes seconds to a minute.`;
	const none = "A model is identified from runs. Add files on Data first.";
	return [
		pageHead(
			"Model",
			"One law for all currents and temperatures. The result is a card, which all later steps use.",
		),
		jobColumns("fit", "What to fit", "Identify", form, {
			read,
			started: ({ card }) => choose({ card, "fit.card": null }),
			disabled: !fitted.length,
			first: runChoice(runs, fitted, without),
			nothing: runs.length ? ready : none,
			view: (job) => fitView(job, runs),
		}),
		fitTable(runs),
	];
}
