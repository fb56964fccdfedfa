// Forms of jobs, built from the declared fields (/api/forms). No option is declared here.
//
// The state contains the entries of a form as the user typed them. Reading a form throws an error for an invalid entry.

import { putInput } from "./api.js";
import { fold } from "./layout.js";
import { app, attempt, cardInUse, cards, choose, chosen } from "./state.js";
import { has, toggled } from "./text.js";
import { check, field, filePicker, rove, select, tags, textField } from "./ui.js";

const { div, h3, input, label, p, span } = tags;
const MORE = "More";
const BOXES_MAX = 6; // Longer lists of boxes scroll.

const DECIMAL = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i;
const THOUSANDS = /^[+-]?[1-9]\d{0,2},\d{3}$/; // 1,234 can mean 1234 or 1.234.

/** Return the number that a text contains, with a decimal point or comma; NaN if it is invalid or ambiguous. */
export function parseNumber(text) {
  const plain = text.trim().replace("−", "-");
  return DECIMAL.test(plain) && !THOUSANDS.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** Return the numbers of a list that is separated by semicolons, blanks, or commas with a blank. */
function parseNumbers(text) {
  const parts = text.split(text.includes(";") ? ";" : /,?\s+/).map((part) => part.trim());
  const values = parts.filter(Boolean);
  return values.length === 1 && /\d,\d/.test(values[0]) ? [NaN] : values.map(parseNumber); // 20,60 can be one or two numbers.
}

const textOf = (value) => (Array.isArray(value) ? value.join("; ") : String(value ?? ""));

function faultOf(text, { many, needed = "" }) {
  if (!text.trim()) return needed;
  const values = many ? parseNumbers(text) : [parseNumber(text)];
  const more = many ? ", and separate several by semicolons" : "";
  return !values.some(Number.isNaN)
    ? ""
    : `“${text.trim()}” is not a number. Enter one such as 2.5 or 2,5${more}.`;
}

/** Return the number (or with `many` the numbers) of an entry; an invalid entry throws an error that names its field. */
export function readNumber(words, entry, { many, needed, otherwise = many ? [] : null } = {}) {
  const text = textOf(entry);
  const fault = faultOf(text, { many, needed });
  if (fault) throw new Error(`${words}: ${fault}`);
  if (!text.trim()) return otherwise;
  return many ? parseNumbers(text) : parseNumber(text);
}

/** Return the input element of a number. It is marked if the entry is invalid, or empty although `needed` is given. */
export function numberInput(entry, change, { many, needed, ...props } = {}) {
  const title = faultOf(textOf(entry), { many, needed });
  const oninput = (event) => change(event.target.value);
  const look = { type: "text", inputmode: "decimal", autocomplete: "off", class: "number" };
  const marked = { title, "aria-invalid": String(Boolean(title)) };
  return input({ ...look, value: textOf(entry), ...marked, oninput, ...props });
}

export const numberField = (words, entry, change, { unit, ...props } = {}) =>
  field(words, numberInput(entry, change, props), unit);

/** Return a number with a slider from `min` to `max` in steps. */
export function slider(words, entry, change, unit, id, [min, max, step]) {
  const value = parseNumber(textOf(entry));
  const range = { min: Math.min(min, value || 0), max: Math.max(max, value || 0), step, value };
  const oninput = (event) => change(Number(event.target.value));
  return div(
    { class: "slider wide" },
    label({ for: id }, `${words}, ${unit}`),
    numberInput(entry, change, { id }),
    input({ type: "range", ...range, "aria-label": `${words} slider`, oninput }),
  );
}

/** Return the key under which the choice of a field is stored. All forms share card, geometry, load cycle and controller. */
function keyOf(kind, { name, word, places }) {
  if (["drawing", "duty"].includes(word)) return word;
  if (name === "controller" || (name === "card" && places.includes("cards"))) return name;
  return `${kind}.${name}`;
}

/** Return a pattern that matches a name literally. */
export const literal = (name) => name.replace(/[[*?]/g, (sign) => `[${sign}]`);

/** Return the names of inputs that have a suffix and one of the kinds, or an unknown kind. */
export const inputsOf = (suffix, kinds) =>
  app.state.inputs
    .filter(({ name }) => name.endsWith(suffix))
    .filter(({ kind }) => !kinds.length || !kind || kinds.includes(kind))
    .map(({ name }) => name);

function itemsOf(one) {
  const { files, records } = app.state;
  const named = (all, words = (name) => name) => all.map(({ name }) => [name, words(name)]);
  const mapped = files.filter((file) => file.mapped);
  const found = {
    inputs: () => inputsOf(one.files, one.looks).map((name) => [name, name]),
    cards: () => cards().map((card) => [card.name, `${card.name} (${card.law})`]),
    records: () => named(records),
    runs: () => named(files),
    maps: () => named(mapped, (name) => `as for ${name}`),
  };
  return one.places.flatMap((place) => found[place]());
}

/**
 * Return the form of a kind of job: `{read(), nodes(), more(), pick(names), rest(names)}`.
 *
 * `given`: values that the page sets; `only`: allowed choices of a field; `offered`: offered names by kind;
 * `needed`: reasons why a field must not be empty; `preset`: initial values instead of the declared ones
 */
export function formOf(kind, options = {}) {
  const { given = {}, only = {}, offered = {}, needed = {}, preset = {} } = options;
  const shown = app.forms[kind].filter((one) => !(one.name in given));
  const controls = shown.map((one) => {
    const key = keyOf(kind, one);
    const begins = preset[one.name] ?? (key === "card" ? cardInUse()?.name : one.begins);
    const names = (offered[one.offers] ?? []).map((name) => [literal(name), name]);
    const keeps = ([value]) => !(one.name in only) || only[one.name].includes(value);
    const items = [...one.choices, ...itemsOf(one), ...names].filter(keeps);
    const id = `${kind}-${one.name.replaceAll("_", "-")}`;
    const entry = chosen(key) ?? begins;
    const about = { ...one, key, id, begins, options: items, needed: needed[one.name], entry };
    const { node, read } = controlOf(about, (value) => choose({ [key]: value }));
    const look = { class: isWide(one) ? "wide" : "", title: one.help };
    return { ...one, read, node: () => div(look, node()) };
  });
  const folds = controls.filter(({ group }) => group === MORE).length > 2;
  const groupOf = ({ group }) => (group === MORE && !folds ? "" : group);
  const nodesOf = (isShown) => controls.filter(isShown).map(({ node }) => node());
  const under = (group) => nodesOf((one) => groupOf(one) === group);
  const groups = [...new Set(controls.map(groupOf))].filter((group) => group !== MORE);
  const section = (group) => [group && h3.gap(group), div({ class: "fields gap" }, under(group))];
  const read = () => Object.fromEntries(controls.map((one) => [one.name, one.read()]));
  return {
    read: () => ({ ...read(), ...given }),
    pick: (names) => nodesOf(({ name }) => names.includes(name)),
    rest: (names) => nodesOf(({ name }) => !names.includes(name)),
    nodes: () => groups.map(section),
    more: (title = MORE) => folds && fold(title, div.fields(under(MORE))),
  };
}

const isWide = ({ many, slider: range, choices, places, type }) =>
  many || range || choices.length > 0 || places.length > 0 || ["yes", "text"].includes(type);

/** Return the control of a field: `{node(), read()}`. */
function controlOf(one, change) {
  const { id, entry, unit, label: words, needed } = one;
  if (one.word === "duty") return { node: () => dutyFields(id), read: readDuty };
  if (one.type === "yes") {
    const node = () => check(words, Boolean(entry), change, { id });
    return { node, read: () => Boolean(entry) };
  }
  if (one.many && one.places.includes("runs") && one.word !== "campaigns") {
    const all = [["", "all runs in the folder"], ...one.options];
    const take = (name) => change(name ? [name] : null);
    const node = () => field(words, select(all, entry?.[0] ?? "", take, { id }));
    return { node, read: () => entry ?? null };
  }
  if (one.many) return severalControl(one);
  if (one.choices.length || one.places.length) return choiceControl(one, change);
  if (one.type === "text") {
    const props = { maxlength: 160, id, placeholder: one.none };
    const read = () => String(entry ?? "").trim() || one.default;
    return { node: () => textField(words, entry ?? "", change, props), read };
  }
  const read = () => readNumber(words, entry, { needed, otherwise: one.default });
  const about = { unit, id, needed, placeholder: one.none };
  const node = () =>
    one.slider
      ? slider(words, entry ?? one.slider[0], change, unit, id, one.slider)
      : numberField(words, entry, change, about);
  return { node, read };
}

function choiceControl(one, change) {
  const { id, word, entry, required } = one;
  const first = required ? `choose a ${word}` : one.none || "none";
  const named = new Map([...(one.default === null ? [["", first]] : []), ...one.options]);
  const isItem = entry && one.places.length > 0 && !one.choices.length;
  const initial = named.has(one.begins) ? one.begins : [...named.keys()][0];
  let value = named.has(entry) || isItem ? entry : initial;
  if (required && !value) value = one.options[0]?.[0] ?? "";
  if (value && !named.has(value)) named.set(value, `${value} (deleted)`);
  const node = () => [
    field(one.label, select([...named], value, change, { id })),
    one.places.includes("inputs") && bringInput(`Bring a ${word}`, one.files, change),
  ];
  return { node, read: () => value || null };
}

function severalControl(one) {
  const { key, id, options, free, places, label: words, none } = one;
  const names = options.map(([value]) => value);
  const many = one.type !== "text";
  const values = one.entry ?? (one.required ? names : []);
  const picked = values.filter((value) => names.includes(value));
  const others = values.filter((value) => !names.includes(value));
  const typed = chosen(`${key}.text`) ?? (many ? textOf(others) : others.join(", "));
  const change = (value) => choose({ [key]: toggled(picked, value), [`${key}.text`]: typed });
  const write = (text) => choose({ [`${key}.text`]: text });
  const props = { id, placeholder: one.offers === "runs" ? "*_060C_*" : none, "aria-label": words };
  const oninput = (event) => write(event.target.value);
  const line = many
    ? numberInput(typed, write, { ...props, many })
    : input({ ...props, type: "text", value: typed, oninput });
  const box = ([value, text]) => check(text, picked.includes(value), () => change(value));
  const isLong = options.length > BOXES_MAX;
  const list = { class: isLong ? "picks" : "", ref: isLong ? rove : null };
  const hint = none && !free ? `; without a choice: ${none}` : "";
  const node = () =>
    div(
      { role: "group", "aria-label": words },
      words !== one.group && span.small(words, one.unit && `, ${one.unit}`, hint),
      options.length > 0 && div(list, options.map(box)),
      free && line,
      places.includes("inputs") && bringInput(`Bring a ${one.word}`, one.files, change),
    );
  const read = () => {
    const texts = () => typed.split(/[,;]+/).map((text) => text.trim());
    const more = many ? () => readNumber(words, typed, { many }) : () => texts().filter(Boolean);
    const all = [...new Set([...picked, ...(free ? more() : [])])];
    return all.length ? all : one.default;
  };
  return { node, read };
}

/** Return a button that uploads an input (a geometry, a table). */
export function bringInput(words, suffixes, brought = () => {}) {
  const bring = ([file]) =>
    attempt(() => putInput(file)).then((answer) => answer && brought(file.name));
  const kinds = suffixes.replaceAll(".", "").toUpperCase();
  return p.small(filePicker(`${words} (${kinds})`, suffixes, bring));
}

/** Fill the form of a job with the options of an earlier job. */
export function fillForm(kind, options, more = {}) {
  const values = {};
  for (const one of app.forms[kind]) {
    const [key, value] = [keyOf(kind, one), options[one.name]];
    values[key] = has(value) ? value : null;
    values[`${key}.text`] = null;
    if (one.word === "duty") values[key] = sineOf(value) ?? { table: value };
  }
  choose({ ...values, ...more });
}

const SINE = /^sine:([-+\d.e]+)mm:([-+\d.e]+)Hz:([-+\d.e]+)([AV]):([-+\d.e]+)s$/;
const USUAL = { amplitude_mm: 15, frequency_Hz: 1, command: 2, duration_s: 1800 };

function sineOf(text) {
  const [amplitude_mm, frequency_Hz, command, , duration_s] = (SINE.exec(text) ?? [])
    .slice(1)
    .map(Number);
  return duration_s && { amplitude_mm, frequency_Hz, command, duration_s };
}

/** Return the load cycle that the user entered, or else a sine inside the range of runs of the card in use. */
function dutyInUse() {
  const { command_unit: unit = "A", envelope } = cardInUse() ?? {};
  const reach = ([low, high] = [-Infinity, Infinity]) => Math.min(-low, high);
  const travel = Math.max(1, Math.floor(reach(envelope?.displacement_mm)));
  const amplitude_mm = Math.min(USUAL.amplitude_mm, travel);
  const speed_Hz = reach(envelope?.velocity_mm_s) / (2 * Math.PI * amplitude_mm);
  const frequency_Hz = Math.min(USUAL.frequency_Hz, Math.max(0.1, Math.floor(10 * speed_Hz) / 10));
  const command_max = envelope?.command?.[1] ?? USUAL.command;
  const command = Math.min(USUAL.command, command_max);
  const first = { ...USUAL, amplitude_mm, frequency_Hz, command };
  return { unit, command_max, ...first, ...chosen("duty") };
}

/** Return the fields of the sine: name, label, unit and range of the slider. */
const sineFields = ({ unit, command_max: max }) => [
  ["command", unit === "V" ? "Voltage" : "Current", unit, [0, Math.max(max, 0.1), 0.05]],
  ["amplitude_mm", "Amplitude", "mm", [1, 50, 1]],
  ["frequency_Hz", "Frequency", "Hz", [0.1, 5, 0.1]],
  ["duration_s", "Duration", "s", [300, 14400, 300]],
];

export function readSine() {
  const duty = dutyInUse();
  const read = ([name, words]) => [name, readNumber(words, duty[name], { otherwise: USUAL[name] })];
  return Object.fromEntries(sineFields(duty).map(read));
}

/** Return the load cycle as text: a sine, or the name of a table. */
function readDuty() {
  const { table, unit } = dutyInUse();
  if (table) return table;
  const { amplitude_mm, frequency_Hz, command, duration_s } = readSine();
  return `sine:${amplitude_mm}mm:${frequency_Hz}Hz:${command}${unit}:${duration_s}s`;
}

function dutyFields(id) {
  const duty = dutyInUse();
  const change = (values) => choose({ duty: { ...chosen("duty"), ...values } });
  const take = (table) => change({ table });
  const tables = [["", "a sine"], ...inputsOf(".csv", ["duty"]).map((name) => [name, name])];
  const sine = ([name, words, unit, range]) =>
    slider(words, duty[name], (value) => change({ [name]: value }), unit, `${id}-${name}`, range);
  return div.fields(
    div.wide(
      field("Motion", select(tables, duty.table ?? "", take, { id })),
      bringInput("Bring a table", ".csv", take),
    ),
    !duty.table && sineFields(duty).map(sine),
  );
}
