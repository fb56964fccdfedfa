// Result of a job as the server sends it: verdict, tiles, warnings, tables, notes.

import { button, el, note, table } from "./dom.js";
import { beyondCard, notes, tile } from "./parts.js";

const SHORT = 22; // Cells with at most this number of letters are not wrapped.

/** Return the verdict and three values with their bands. */
export function firstScreen({ kind, answer }) {
  if (!answer.shown) return note("info", "An earlier version ran this job. Its result is in its report and files.");
  const { verdict, tiles } = answer.shown;
  const mark = beyondCard(answer);
  return [
    el("p", { class: "verdict", text: verdict }),
    el("div", { class: "tiles three", id: `${kind}-tiles` }, tiles.map(({ label, value, band }) => tile(label, value, mark, band))),
  ];
}

/** Return the subject of a result and its warnings. */
export function groundsOf({ answer }) {
  const { subject, flags } = answer.shown ?? { subject: "", flags: [] };
  return [el("p", { class: "small", text: subject }), flags.map(([lead, text]) => note("warning", el("b", { text: lead }), ` ${text}`))];
}

/** Return the tables of a result; `address` returns the address of the plot of a run. */
export const tablesOf = ({ answer }, address = null) => (answer.shown?.tables ?? []).map((one) => tableOf(one, address));

/**
 * Return one table. With a `choice`, `{pick(n), picked(n), words(cells)}`, a button in the first column chooses a row.
 */
export function tableOf({ title, caption, folded, columns, rows }, address = null, choice = null) {
  const cell = (column, k) => (row) => {
    const text = row.cells[k];
    if (column.names_run && address) return el("a", { href: address(text), text });
    if (k || !choice) return text;
    const n = rows.indexOf(row);
    return button(choice.words(row.cells), () => choice.pick(n), { class: "quiet", "aria-pressed": String(choice.picked(n)) });
  };
  const width = (k) => (rows.every(({ cells }) => (cells[k] ?? "").length <= SHORT) ? "whole" : "name");
  const made = table(
    columns.map((column, k) => ({ ...column, class: width(k), cell: cell(column, k) })),
    rows,
    { label: title, rowClass: (row) => (choice?.picked(rows.indexOf(row)) ? "chosen" : row.held ? "held" : "") },
  );
  return [
    el("h2", { text: title }),
    caption && el("p", { class: "small", text: caption }),
    folded ? el("details", {}, el("summary", { text: folded }), made) : made,
  ];
}

/** Return the notes of a result. */
export const notesOf = ({ answer }) => notes(answer.shown?.notes ?? answer.notes);

/** Return subject, warnings, tables and notes. */
export const restOf = (job) => [groundsOf(job), tablesOf(job), notesOf(job)];
