// Helpers that build the page. All text is inserted as text, never as markup.

/**
 * Return an element. `props` sets attributes; `on...` adds listeners; `class`, `text` and `value` set these properties.
 * A string becomes a text node. Null and false are ignored.
 */
export function el(name, props = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "class") node.className = value;
    else if (key === "text") node.textContent = value;
    else if (key === "value") node.value = value;
    else if (value === true) node.setAttribute(key, "");
    else node.setAttribute(key, String(value));
  }
  add(node, children);
  return node;
}

function add(node, children) {
  for (const child of children.flat(Infinity)) {
    if (child === null || child === undefined || child === false) continue;
    node.append(child instanceof Node ? child : String(child));
  }
}

/** Return the query of the address. */
export const addressed = () => new URLSearchParams(window.location.hash.split("?")[1] ?? "");

/** Return a link that opens a file in a new tab. */
export const opening = (href, text, props = {}) => el("a", { href, text, target: "_blank", rel: "noopener", ...props });

/** Return a hidden file field, `{picker, pick()}`; `taken` receives the list of files. */
export function filePicker(accept, taken, props = {}) {
  const picker = el("input", { type: "file", accept, hidden: true, ...props });
  picker.addEventListener("change", () => {
    const files = [...picker.files];
    picker.value = ""; // The same file can be chosen again.
    taken(files);
  });
  return { picker, pick: () => picker.click() };
}

/** Replace the children of a node. */
export function fill(node, ...children) {
  node.replaceChildren();
  add(node, children);
  return node;
}

const SVG = "http://www.w3.org/2000/svg";

/** Return an SVG element with attributes and children. */
export function svg(name, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, String(value));
  add(node, children);
  return node;
}

let fields = 0;

/** Return a labelled field: the label with the unit, the control, and a hint. */
export function field(label, control, { unit = "", hint = "", wide = false } = {}) {
  fields += 1;
  const id = control.id || `f${fields}`;
  control.id = id;
  if (hint) control.setAttribute("aria-describedby", `${id}-hint`);
  return el(
    "div",
    { class: wide ? "field wide" : "field" },
    el("label", { for: id, text: unit ? `${label}, ${unit}` : label }),
    control,
    hint && el("p", { class: "hint", id: `${id}-hint`, text: hint }),
  );
}

const DECIMAL = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i;
const THOUSANDS = /^[+-]?[1-9]\d{0,2},\d{3}$/; // 1,234 has two meanings.

/** Return the number that a text contains, with a decimal point or comma; NaN if it is invalid or ambiguous. */
export function parseNumber(text) {
  const plain = text.trim().replace("−", "-");
  return DECIMAL.test(plain) && !THOUSANDS.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** Return the numbers of a list that is separated by semicolons, blanks, or commas with a blank. */
function parseNumbers(text) {
  const parts = text.split(text.includes(";") ? ";" : /,?\s+/).map((part) => part.trim()).filter(Boolean);
  return parts.length === 1 && /\d,\d/.test(parts[0]) ? [NaN] : parts.map(parseNumber); // 20,60 has two meanings.
}

/**
 * Return the field of a number (of several with `list`): `{input, node, read(), set(value), require(reason)}`.
 *
 * An invalid entry marks the field, and `read` throws an error that names the field and the entry.
 */
export function numberField(label, unit, value, { list = false, empty = null, hint = "", ...props } = {}) {
  const input = el("input", { type: "text", inputmode: "decimal", autocomplete: "off", class: "number", ...props });
  let needed = "";
  const fault = () => {
    const text = input.value.trim();
    if (!text) return needed;
    const values = list ? parseNumbers(text) : [parseNumber(text)];
    return values.some(Number.isNaN) ? `“${text}” is not a number. Enter one such as 2.5 or 2,5${list ? ", and separate several by semicolons" : ""}.` : "";
  };
  const mark = () => {
    input.title = fault();
    input.setAttribute("aria-invalid", String(Boolean(input.title)));
  };
  const set = (next) => {
    input.value = list ? (next ?? []).join("; ") : next ?? "";
    mark();
  };
  input.addEventListener("input", mark);
  set(value);
  return {
    input,
    node: field(label, input, { unit, hint }),
    set,
    read() {
      mark();
      if (input.title) throw new Error(`${label}: ${input.title}`);
      if (!input.value.trim()) return empty;
      return list ? parseNumbers(input.value) : parseNumber(input.value);
    },
    /** Mark the field while it is empty, with a reason; without a reason it may be empty. */
    require(reason) {
      needed = reason;
      mark();
    },
  };
}

/** Return a drop-down list of `[value, text]` pairs (or plain texts). */
export function select(options, chosen, props = {}) {
  const node = el("select", props);
  for (const option of options) {
    const [value, text] = Array.isArray(option) ? option : [option, option];
    node.append(el("option", { value, text, selected: value === chosen }));
  }
  return node;
}

/** Return a check box with its label. */
export function check(text, checked, props = {}) {
  const box = el("input", { type: "checkbox", ...props });
  box.checked = checked;
  return { box, node: el("label", { class: "check" }, box, el("span", { text })) };
}

/** Return a button. */
export function button(text, onclick, props = {}) {
  return el("button", { type: "button", onclick, ...props }, text);
}

const MANY = 12; // Longer tables scroll and are one stop of Tab.

/**
 * Make a list one stop of Tab. Left and Right move through the controls of a row, Up and Down through the rows.
 * Return the function to be called after the list was drawn again.
 */
export function rove(place) {
  const all = () => [...place.querySelectorAll("button, a[href], input, summary")].filter((one) => !one.disabled);
  const settle = (at) => all().forEach((one, k) => (one.tabIndex = one === at || (!at && k === 0) ? 0 : -1));
  place.addEventListener("focusin", ({ target }) => settle(target));
  place.addEventListener("keydown", (event) => {
    const items = all();
    const row = (one) => one.closest("tr, label");
    const rows = [...new Set(items.map(row))];
    const inRow = items.filter((one) => row(one) === row(event.target));
    const at = inRow.indexOf(event.target);
    const k = rows.indexOf(row(event.target));
    const of = (n) => items.filter((one) => row(one) === rows[n]);
    const next = {
      ArrowRight: () => inRow[at + 1],
      ArrowLeft: () => inRow[at - 1],
      ArrowDown: () => (rows.length === 1 ? inRow[at + 1] : of(k + 1)[at] ?? of(k + 1)[0]),
      ArrowUp: () => (rows.length === 1 ? inRow[at - 1] : of(k - 1)[at] ?? of(k - 1)[0]),
      Home: () => items[0],
      End: () => items.at(-1),
    }[event.key];
    if (!next || at < 0) return;
    event.preventDefault();
    next()?.focus();
  });
  return () => settle(null);
}

/**
 * Return a table.
 *
 * @param {{title: string, unit?: string, number?: boolean, cell: (row: any) => any}[]} columns
 * @param {any[]} rows
 */
export function table(columns, rows, { caption = "", label = caption || "table", rowClass = null, tall = false } = {}) {
  const head = el("tr");
  for (const column of columns) {
    head.append(
      el("th", { class: column.number ? "n" : "", scope: "col" }, column.title, column.unit && el("small", { text: column.unit })),
    );
  }
  const body = el("tbody");
  for (const row of rows) {
    const line = el("tr", { class: rowClass ? rowClass(row) : "" });
    for (const column of columns) {
      const made = column.cell(row);
      line.append(el("td", { class: column.number ? "n" : column.class || "" }, made === null || made === undefined ? (column.title ? "–" : "") : made));
    }
    body.append(line);
  }
  if (rows.length > MANY) rove(body)();
  return el("div", { class: tall || rows.length > MANY ? "scroll tall" : "scroll", tabindex: 0, role: "region", "aria-label": label },
    el("table", {}, caption && el("caption", { text: caption }), el("thead", {}, head), body));
}

/** Return a box with the next action for a page without content. */
export function empty(title, text, ...actions) {
  return el("div", { class: "empty" }, el("h3", { text: title }), el("p", { text }), actions.length > 0 && el("p", {}, actions));
}

/** Return a note; `kind` is `info`, `warning`, `fault` or `good`. */
export function note(kind, ...children) {
  return el("div", { class: `notice ${kind}`, role: kind === "fault" ? "alert" : "status" }, ...children);
}

/** Return a number with `digits` significant digits, with an exponent only for very large or small values. */
export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(Number(value.toPrecision(digits)));
  if (size >= 1e5 || size < 1e-3) return value.toExponential(digits - 1).replace("e+", "e").replace("-", "−");
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return fixed(value, decimals);
}

/** Return a number with a fixed number of decimals, or a dash. */
export function fixed(value, decimals = 1) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return value.toFixed(decimals).replace("-", "−");
}

/** Return true if there is a value. */
export const has = (value) => value !== null && value !== undefined;

/** Return a whole number with separated thousands. */
export const counted = (count) => (count ?? 0).toLocaleString("en-GB").replaceAll(",", " ");

/** Return a time in words: `4 min 10 s`. */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "–";
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  const rest = Math.round(seconds - 60 * minutes);
  if (minutes < 120) return rest ? `${minutes} min ${rest} s` : `${minutes} min`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** Return a size in words: `2.4 MB`. */
export function bytes(count) {
  if (!Number.isFinite(count)) return "–";
  if (count < 1000) return `${count} B`;
  if (count < 1e6) return `${(count / 1e3).toFixed(count < 1e4 ? 1 : 0)} kB`;
  if (count < 1e9) return `${(count / 1e6).toFixed(1)} MB`;
  return `${(count / 1e9).toFixed(1)} GB`;
}

/** Download a blob. */
export function save(name, blob) {
  const address = URL.createObjectURL(blob);
  const link = el("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
