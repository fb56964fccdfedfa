// Boxes of the pages: tables, tabs, folds, notes and tiles.

import { choose, chosen, go, PAGES } from "./state.js";
import { button, rove, tags } from "./ui.js";

const { b, caption, details, div, h1, h2, i, li, p, section, small, span, summary } = tags;
const { table: sheet, tbody, td, th, thead, tr, ul } = tags;
const ROWS_MAX = 12; // A longer table is scrolled, and the Tab key stops only once in it.

/** Return a table; a column is `[title, cell(row), class (`n`: number), unit]`. */
export function table(words, columns, rows, options = {}) {
	const { rowClass = () => "", tall, note: remark } = options;
	const isLong = rows.length > ROWS_MAX;
	const head = ([title, , look, unit]) =>
		th({ class: look, scope: "col" }, title, unit && small(unit));
	const cells = (row) =>
		columns.map(([title, cell, look]) => td({ class: look }, cell(row) ?? (title ? "–" : "")));
	const body = rows.map((row) => tr({ class: rowClass(row) }, cells(row)));
	const content = [thead(tr(columns.map(head))), tbody({ ref: isLong ? rove : null }, body)];
	const look = tall || isLong ? "scroll tall" : "scroll";
	const about = { class: look, tabindex: 0, role: "region", "aria-label": words };
	return div(about, sheet(remark && caption(remark), content));
}

/** Return tabs from pairs `[title, body()]`; null and false are ignored. */
export function tabbed(words, key, tabs) {
	const shown = tabs.filter(Boolean);
	const [title, body] = shown.find(([one]) => one === chosen(key)) ?? shown[0];
	const one = ([text]) => {
		const props = { role: "tab", "aria-selected": String(text === title) };
		return button(text, () => choose({ [key]: text }), "", props);
	};
	const list = div.tabs({ role: "tablist", "aria-label": words }, shown.map(one));
	return div(list, div({ key: title }, body()));
}

export const fold = (title, ...children) => details(summary(title), children);

/** Return a foldable section. Its state is a choice; `body()` is called only if it is open. */
export function keptFold(key, id, title, body) {
	const open = chosen(key, false);
	const toggle = ({ target }) => target.open !== open && choose({ [key]: target.open || null });
	return details({ id, open, ontoggle: toggle }, summary(title), open && body());
}

export const note = (kind, ...children) =>
	div({ class: `notice ${kind}`, role: kind === "fault" ? "alert" : "status" }, children);

export const pageHead = (title, text) => [h1(title), p.sub(text)];

export const titled = (title, ...body) => section({ "aria-label": title }, h2(title), body);

export const empty = (text, page = "") =>
	div.empty(p(text), page && button(`Go to ${PAGES[page].title}`, () => go(page), "main"));

/** Return a tile; `mark` states that its value is assumed or extrapolated. */
export const tile = (name, value, mark = "", band = "") =>
	div(
		{ class: mark ? "tile marked" : "tile", title: mark },
		span(name),
		b(value),
		band && small(band),
		mark && i(mark),
	);

export const notes = (texts) =>
	texts?.length ? ul.notes([...new Set(texts)].map((text) => li(text))) : null;

export const tag = (kind, text = kind, title = "") => span({ class: `tag ${kind}`, title }, text);
