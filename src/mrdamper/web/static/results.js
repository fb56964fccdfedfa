// Result of a job as the server sends it: verdict, tables, files, and findings on runs.

import { jobFile } from "./api.js";
import { fold, note, notes, tabbed, table, tag, tile } from "./layout.js";
import { address } from "./state.js";
import { bytes, has, number } from "./text.js";
import { button, opening, tags } from "./ui.js";

const { a, b, div, li, p, span, ul } = tags;

const BEYOND = /^(?:the duty's |the )?(\w+) .*; the card was identified/; // a note that a quantity is outside the range of the card's runs

/** Return the quantities in which a result exceeds the range of the card's runs; empty if there are none. */
export function beyondCard({ notes: texts = [] }) {
  const found = texts.map((text) => BEYOND.exec(text)?.[1]).filter(Boolean);
  return found.length ? `extrapolated: ${found.join(", ")}` : "";
}

/** Return the verdict and three values with their bands. */
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

/**
 * Return one table of a result; `link(run)` is the address of a run. With a `choice`, `{pick(n), isPicked(n), words(cells)}`,
 * a button in the first column chooses a row.
 */
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

/** Return tables and notes of a result as tabs, after the tabs in `first`. */
export function tabsOf(key, { answer }, first = [], link = null) {
  const texts = answer.shown?.notes ?? answer.notes;
  const tables = (answer.shown?.tables ?? []).map((one) => [
    one.title,
    () => tableOf(one, { link }),
  ]);
  const last = ["Notes", () => notes(texts) ?? p.small("No notes.")];
  return tabbed("Parts of the result", key, [...first, ...tables, last]);
}

/** Return links to the report of a job, if it has one, and to its other files. */
export function filesOf(job, words = "Open the report", only = () => true) {
  const files = (job.files ?? []).filter(({ path }) => only(path));
  const one = ({ path, bytes: size }) => {
    const href = jobFile(job.id, path);
    if (path.endsWith(".html")) return opening(href, words, { class: "button" });
    return a.button({ href, download: path.split("/").pop() }, path, span.small(bytes(size)));
  };
  return div.actions(files.map(one));
}

const AROUND_S = 0.5; // Time that is shown before and after a finding.
const SEVERITIES = ["fault", "warning", "note"];

/** Return findings in groups by kind. Each run is a link to the location of the finding in the plots. */
export function findingList(findings) {
  const kindOf = ({ severity, found }) => `${severity}: ${found.replace(/[-−+]?\d[\d.,]*/g, "#")}`;
  const rank = ([{ severity }]) => SEVERITIES.indexOf(severity);
  const groups = [...Map.groupBy(findings, kindOf).values()].sort((x, y) => rank(x) - rank(y));
  return groups.map((group) => {
    const [{ severity, found, effect, remedy }, ...others] = group;
    const more = others.length ? ` (and ${others.length} similar)` : "";
    const place = (one) =>
      li(a({ href: placeOf(one) }, `${one.run}${whereOf(one)}`), more && `: ${one.found}`);
    const title = [tag(severity), ` ${found}${more}`];
    return fold(title, p.small(`${effect}. ${remedy}.`), ul.notes(group.map(place)));
  });
}

function placeOf({ run, from_s: from, to_s: to }) {
  if (!has(from)) return address("data", { "view.runs": [run] });
  const around = Math.max(AROUND_S, ((to ?? from) - from) / 2);
  return address("data", { "view.runs": [run], "view.t": [from - around, (to ?? from) + around] });
}

function whereOf({ channel, from_s: from, to_s: to }) {
  if (!has(from)) return channel ? `, ${channel}` : "";
  const end = has(to) && to !== from ? ` to ${number(to, 4)}` : "";
  return `, ${channel || "time"} at ${number(from, 4)}${end} s`;
}
