// Result of a job as the server sends it: verdict, tables, files, and findings on runs.

import { at } from "./api.js";
import { fold, note, notes, tabbed, table, tag, tile } from "./layout.js";
import { address } from "./state.js";
import { bytes, has, number } from "./text.js";
import { button, opening, tags } from "./ui.js";

const { a, b, div, p, span } = tags;

const BEYOND = /^(?:the duty's |the )?(\w+) .*; the card was identified/;

/** Return the quantities in which a result exceeds the range of the card's runs, from its notes. */
export function beyondCard({ notes: texts = [] }) {
	const found = texts.map((text) => BEYOND.exec(text)?.[1]).filter(Boolean);
	return found.length ? `extrapolated: ${found.join(", ")}` : "";
}

export function firstScreen({ kind, answer }) {
	if (!answer.shown) return null;
	const mark = beyondCard(answer);
	const one = ({ label, value, band }) => tile(label, value, mark, band);
	return [
		p.verdict(answer.shown.verdict),
		div.tiles({ id: `${kind}-tiles` }, answer.shown.tiles.map(one)),
	];
}

export const groundsOf = ({ answer: { shown } }) =>
	shown && [
		p.small(shown.subject),
		shown.flags.map(([lead, text]) => note("warning", b(lead), ` ${text}`)),
	];

const SHORT = 22; // Cells with at most this number of letters are not wrapped.

/** Return a table of a result; `link(run)`: address of a run; `choice`: buttons for the rows. */
export function tableOf({ title, caption, folded, columns, rows }, { link, choice } = {}) {
	const isPicked = (row) => choice?.isPicked(rows.indexOf(row));
	const pick = (row) => {
		const props = { "aria-pressed": String(isPicked(row)) };
		return button(choice.words(row.cells), () => choice.pick(rows.indexOf(row)), "quiet", props);
	};
	const column = ({ title: head, unit, number: isNumber, names_run: isRun }, k) => {
		const textOf = (row) => row.cells[k];
		const isShort = rows.every((row) => (textOf(row) ?? "").length <= SHORT);
		const linked = (row) => a({ href: link(textOf(row)) }, textOf(row));
		const cell = isRun && link ? linked : choice && k === 0 ? pick : textOf;
		return [head, cell, isNumber ? "n" : isShort ? "whole" : "name", unit];
	};
	const rowClass = (row) => (isPicked(row) ? "chosen" : row.held ? "held" : "");
	const made = table(title, columns.map(column), rows, { rowClass });
	return [caption && p.small(caption), folded ? fold(folded, made) : made];
}

function tabsOf(key, { answer }, first = [], link = null) {
	const { tables = [], notes: texts = answer.notes } = answer.shown ?? {};
	const tabs = tables.map((one) => [one.title, () => tableOf(one, { link })]);
	const last = ["Notes", () => notes(texts) ?? p.small("No notes.")];
	return tabbed("Parts of the result", key, [...first, ...tabs, last]);
}

export function filesOf(job, only = () => true) {
	const files = (job.files ?? []).filter(({ path }) => only(path));
	const one = ({ path, bytes: size }) => {
		const href = at`jobs/${job.id}/files/${path}`;
		if (path.endsWith(".html")) return opening(href, "Open the report", { class: "button" });
		return a.button({ href, download: path.split("/").pop() }, path, span.small(bytes(size)));
	};
	return div.actions(files.map(one));
}

export const resultView = (job, key, { own, tabs, link, only } = {}) => [
	firstScreen(job),
	own,
	groundsOf(job),
	filesOf(job, only),
	tabsOf(key, job, tabs, link),
];

const AROUND_S = 0.5; // Time that is shown before and after a finding.

/** Return a table of findings, worst first, with links to their locations in the plots. */
export function findingList(findings) {
	const rank = ({ severity }) => "fault, warning, note".indexOf(severity);
	const words = ({ effect, remedy }) => `${effect}. ${remedy}.`;
	const sorted = findings.toSorted((x, y) => rank(x) - rank(y) || words(x).localeCompare(words(y)));
	const isRepeated = (one) => words(one) === words(sorted[sorted.indexOf(one) - 1] ?? {});
	const columns = [
		["", ({ severity }) => tag(severity), "whole"],
		["run", (one) => a({ href: placeOf(one) }, `${one.run}${whereOf(one)}`), "name"],
		["finding", ({ found }) => found, "name"],
		["effect and remedy", (one) => (isRepeated(one) ? "as above" : words(one)), "name"],
	];
	return table("Findings", columns, sorted);
}

function placeOf({ run, from_s: from, to_s: to }) {
	if (!has(from)) return address("data", { "view.runs": [run] });
	const around = Math.max(AROUND_S, ((to ?? from) - from) / 2);
	return address("data", { "view.runs": [run], "view.t": [from - around, (to ?? from) + around] });
}

function whereOf({ channel, from_s: from }) {
	const words = channel ? `, ${channel}` : "";
	return has(from) ? `${words} at ${number(from, 4)} s` : words;
}
