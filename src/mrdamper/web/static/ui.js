// Elements of the pages, numbers as texts, and files. All text is inserted as text, never as markup.

import { h } from "./vendor/preact.js";

const isProps = (value) =>
  value !== null && typeof value === "object" && value.constructor === Object;

/** Functions of HTML and SVG elements: `p({class: "small"}, "text")` or `p("text")`. */
export const tags = new Proxy(
  {},
  {
    get:
      (_, name) =>
      (first, ...rest) =>
        isProps(first) ? h(name, first, ...rest) : h(name, null, first, ...rest),
  },
);
const { a, b, caption, details, div, i, input, label, li, option, small, span, summary, ul } = tags;
const { p, select: list, table: sheet, tbody, td, th, thead, tr } = tags;

export const has = (value) => value !== null && value !== undefined;

// ------------------------------------------------------------------------------------------------ numbers

/** Return a number with a fixed number of decimals, or a dash. */
export const fixed = (value, decimals = 1) =>
  Number.isFinite(value) ? value.toFixed(decimals).replace("-", "−") : "–";

/** Return a number with `digits` significant digits, with an exponent only for very large or small values. */
export function number(value, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(Number(value.toPrecision(digits)));
  if (size >= 1e5 || size < 1e-3)
    return value
      .toExponential(digits - 1)
      .replace("e+", "e")
      .replace("-", "−");
  return fixed(value, Math.max(0, digits - 1 - Math.floor(Math.log10(size))));
}

/** Return a whole number with separated thousands. */
export const counted = (count) => (count ?? 0).toLocaleString("en-GB").replaceAll(",", " ");

/** Return a number of items in words: `1 run`, `3 runs`. */
export const several = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

/** Return a time in words: `4 min 10 s`. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 120) return `${minutes} min ${Math.round(seconds - 60 * minutes)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** Return a size in words: `2.4 MB`. */
export function bytes(count) {
  const power = Math.min(3, Math.floor(Math.log10(Math.max(1, count)) / 3));
  return `${(count / 1e3 ** power).toFixed(power > 1 ? 1 : 0)} ${["B", "kB", "MB", "GB"][power]}`;
}

/** Return a date and time in words. */
export const when = (text) =>
  text ? new Date(text).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "–";

// ----------------------------------------------------------------------------------------------- controls

export const button = (text, onclick, props = {}) =>
  tags.button({ type: "button", onclick, ...props }, text);

/** Return a link that opens a file in a new tab. */
export const opening = (href, text, props = {}) =>
  a({ href, target: "_blank", rel: "noopener", ...props }, text);

/** Return a labelled control, which has an id: the label with the unit, the control, and a hint. */
export const field = (words, control, { unit = "", wide = false, title = "" } = {}) =>
  div(
    { class: wide ? "field wide" : "field", title },
    label({ for: control.props.id }, unit ? `${words}, ${unit}` : words),
    control,
  );

/** Return a drop-down list of `[value, text]` pairs (or plain texts); `onchange` receives the value. */
export const select = (options, chosen, onchange, props = {}) =>
  list(
    { ...props, value: chosen, onchange: (event) => onchange(event.target.value) },
    options
      .map((one) => (Array.isArray(one) ? one : [one, one]))
      .map(([value, text]) => option({ value, key: value, selected: value === chosen }, text)),
  );

/** Return a check box with its label; `onchange` receives its state. */
export const check = (text, checked, onchange, props = {}) =>
  label(
    { class: "check", key: text },
    input({
      type: "checkbox",
      checked,
      onchange: (event) => onchange(event.target.checked),
      ...props,
    }),
    span(text),
  );

/** Return a button that opens a file dialog; `taken` receives the list of files. */
export function filePicker(words, accept, taken, { class: look = "quiet", ...props } = {}) {
  const chosen = (event) => {
    const files = [...event.target.files];
    event.target.value = ""; // The same file can be chosen again.
    taken(files);
  };
  const open = (event) => event.target.nextElementSibling.click();
  return span(
    button(words, open, { class: look }),
    input({ type: "file", accept, hidden: true, onchange: chosen, "aria-label": words, ...props }),
  );
}

/** Return a list without `value`, or with it. */
export const toggled = (values, value) =>
  values.includes(value) ? values.filter((one) => one !== value) : [...values, value];

/** Make a list one stop of Tab: arrow keys, Home and End move through its controls. */
export function rove(place) {
  if (!place) return;
  const all = () =>
    [...place.querySelectorAll("button, a[href], input, summary")].filter((one) => !one.disabled);
  const settle = (at) =>
    all().forEach((one, k) => (one.tabIndex = one === at || (!at && k === 0) ? 0 : -1));
  const rowOf = (one) => one.closest("tr, label, li");
  place.onfocusin ??= settle;
  settle(place.contains(document.activeElement) ? document.activeElement : null);
  if (place.dataset.roves) return;
  place.dataset.roves = "yes";
  place.addEventListener("focusin", ({ target }) => settle(target));
  place.addEventListener("keydown", (event) => {
    const items = all();
    const rows = [...new Set(items.map(rowOf))];
    const of = (row) => items.filter((one) => rowOf(one) === row);
    const mine = of(rowOf(event.target));
    const [at, k] = [mine.indexOf(event.target), rows.indexOf(rowOf(event.target))];
    const next = {
      ArrowRight: mine[at + 1],
      ArrowLeft: mine[at - 1],
      ArrowDown: of(rows[k + 1])[at] ?? of(rows[k + 1])[0],
      ArrowUp: of(rows[k - 1])[at] ?? of(rows[k - 1])[0],
      Home: items[0],
      End: items.at(-1),
    }[event.key];
    if (!next) return;
    event.preventDefault();
    next.focus();
  });
}

const ROWS_MAX = 12; // Longer tables scroll and are one stop of Tab.

/**
 * Return a table.
 *
 * @param {{title: any, unit?: string, number?: boolean, class?: string, cell: (row: any) => any}[]} columns
 * @param {any[]} rows
 */
export function table(
  columns,
  rows,
  { label: words = "table", rowClass = () => "", tall = false, note: said } = {},
) {
  const isTall = tall || rows.length > ROWS_MAX;
  const lookOf = (column) => (column.number ? "n" : (column.class ?? ""));
  return div(
    { class: isTall ? "scroll tall" : "scroll", tabindex: 0, role: "region", "aria-label": words },
    sheet(
      said && caption(said),
      thead(
        tr(
          columns.map((one) =>
            th({ class: lookOf(one), scope: "col" }, one.title, one.unit && small(one.unit)),
          ),
        ),
      ),
      tbody(
        { ref: rows.length > ROWS_MAX ? rove : null },
        rows.map((row) =>
          tr(
            { class: rowClass(row) },
            columns.map((one) =>
              td({ class: lookOf(one) }, one.cell(row) ?? (one.title ? "–" : "")),
            ),
          ),
        ),
      ),
    ),
  );
}

/** Return a note; `kind` is `info`, `warning`, `fault` or `good`. */
export const note = (kind, ...children) =>
  div({ class: `notice ${kind}`, role: kind === "fault" ? "alert" : "status" }, children);

/** Return a box with the next action for a page without content. */
export const empty = (title, text, ...actions) =>
  div({ class: "empty" }, tags.h3(title), p(text), p(actions));

/** Return a tile with a value and its `band`; `mark` names assumptions and extrapolation. */
export const tile = (name, value, mark = "", band = "") =>
  div(
    { class: mark ? "tile marked" : "tile", title: mark },
    span(name),
    b(value),
    band && small(band),
    mark && i(mark),
  );

/** Return notes as a list; null if there are no notes. */
export const notes = (texts) =>
  texts?.length
    ? ul(
        { class: "notes" },
        [...new Set(texts)].map((text) => li(text)),
      )
    : null;

export const fold = (title, ...children) => details(summary(title), children);

export const tag = (kind, text = kind, title = "") => span({ class: `tag ${kind}`, title }, text);

// -------------------------------------------------------------------------------------------------- files

/** Download a blob. */
export function save(name, blob) {
  const link = Object.assign(document.createElement("a"), {
    href: URL.createObjectURL(blob),
    download: name,
  });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** Return rows of texts and numbers as parts of a CSV file. */
export function csvText(rows) {
  const guarded = (text) => (/^[=+\-@\t\r]/.test(text) ? `'${text}` : text); // A spreadsheet would evaluate the text.
  const cell = (value) => {
    if (typeof value === "string") return `"${guarded(value).replaceAll('"', '""')}"`;
    return Number.isFinite(value) ? String(Number(Number(value).toPrecision(9))) : "";
  };
  return rows.map((row) => `${row.map(cell).join(",")}\n`);
}
