// Forms of jobs, built from the declared fields (/api/forms). No option is declared here.
//
// The state holds the entries of a form as they were typed. Reading a form throws an error for an invalid entry.

import { putInput } from "./api.js";
import { app, attempt, cardInUse, cards, choose, chosen, refresh } from "./state.js";
import { check, field, filePicker, fold, has, rove, select, tags, toggled } from "./ui.js";

const { div, h3, input, label, p, span } = tags;
const MORE = "More";
const BOXES_MAX = 6; // Longer lists of boxes scroll.

// ------------------------------------------------------------------------------------------------- numbers

const DECIMAL = /^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i;
const THOUSANDS = /^[+-]?[1-9]\d{0,2},\d{3}$/; // 1,234 has two meanings.

/** Return the number that a text contains, with a decimal point or comma; NaN if it is invalid or ambiguous. */
export function parseNumber(text) {
  const plain = text.trim().replace("−", "-");
  return DECIMAL.test(plain) && !THOUSANDS.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** Return the numbers of a list that is separated by semicolons, blanks, or commas with a blank. */
function parseNumbers(text) {
  const parts = text.split(text.includes(";") ? ";" : /,?\s+/).map((part) => part.trim());
  const values = parts.filter(Boolean);
  return values.length === 1 && /\d,\d/.test(values[0]) ? [NaN] : values.map(parseNumber); // 20,60 has two meanings.
}

const textOf = (value) => (Array.isArray(value) ? value.join("; ") : String(value ?? ""));

function faultOf(text, { many, needed = "" }) {
  if (!text.trim()) return needed;
  const isValid = (many ? parseNumbers(text) : [parseNumber(text)]).every(
    (value) => !Number.isNaN(value),
  );
  const more = many ? ", and separate several by semicolons" : "";
  return isValid ? "" : `“${text.trim()}” is not a number. Enter one such as 2.5 or 2,5${more}.`;
}

/** Return the number (or with `many` the numbers) of an entry; an invalid entry throws an error that names its field. */
export function readNumber(
  words,
  entry,
  { many = false, needed = "", otherwise = many ? [] : null } = {},
) {
  const text = textOf(entry);
  const fault = faultOf(text, { many, needed });
  if (fault) throw new Error(`${words}: ${fault}`);
  if (!text.trim()) return otherwise;
  return many ? parseNumbers(text) : parseNumber(text);
}

/** Return the input of a number; an invalid entry marks it, and an empty one if a reason `needed` is given. */
export function numberInput(entry, change, { many, needed, ...props } = {}) {
  const title = faultOf(textOf(entry), { many, needed });
  const oninput = (event) => change(event.target.value);
  const look = { type: "text", inputmode: "decimal", autocomplete: "off", class: "number" };
  return input({
    ...look,
    value: textOf(entry),
    title,
    "aria-invalid": String(Boolean(title)),
    oninput,
    ...props,
  });
}

/** Return a labelled field of a number. */
export const numberField = (words, entry, change, { unit = "", wide, ...props } = {}) =>
  field(words, numberInput(entry, change, props), { unit, wide });

/** Return a number with a slider. */
export function slider(words, entry, change, { unit, min, max, step, id }) {
  const value = parseNumber(textOf(entry));
  const range = {
    type: "range",
    min: Math.min(min, value || 0),
    max: Math.max(max, value || 0),
    step,
    value,
  };
  return div(
    { class: "slider wide" },
    label({ for: id }, `${words}, ${unit}`),
    numberInput(entry, change, { id }),
    input({
      ...range,
      "aria-label": `${words} slider`,
      oninput: (event) => change(Number(event.target.value)),
    }),
  );
}

// -------------------------------------------------------------------------------------------------- fields

/** Return the key of the choice of a field; card, geometry, load cycle and controller are shared by all forms. */
function keyOf(kind, { name, word, places }) {
  if (["drawing", "duty"].includes(word)) return word;
  if (name === "controller" || (name === "card" && places.includes("cards"))) return name;
  return `${kind}.${name}`;
}

/** Return a pattern that matches a name literally. */
export const literal = (name) => name.replace(/[[*?]/g, (sign) => `[${sign}]`);

/** Return the names of inputs with a suffix and one of some kinds; inputs of unknown kind are included. */
export const inputsOf = (suffix, kinds) =>
  app.state.inputs
    .filter(
      ({ name, kind }) => name.endsWith(suffix) && (!kinds.length || !kind || kinds.includes(kind)),
    )
    .map(({ name }) => name);

/** Return the items of the folder that a field offers, as `[value, text]` pairs. */
function itemsOf(one) {
  const { files, records } = app.state;
  const named = (all) => all.map(({ name }) => [name, name]);
  const found = {
    inputs: () => inputsOf(one.files, one.looks).map((name) => [name, name]),
    cards: () => cards().map((card) => [card.name, `${card.name} (${card.law})`]),
    records: () => named(records),
    runs: () => named(files),
    maps: () => files.filter(({ mapped }) => mapped).map(({ name }) => [name, `as for ${name}`]),
  };
  return one.places.flatMap((place) => found[place]());
}

/**
 * Return the form of a kind of job: `{read(), nodes(), more(), pick(names), rest(names)}`.
 *
 * `given`: values that the page sets; `only`: choices that a field keeps; `offered`: names by kind of offer;
 * `needed`: reasons why a field must not be empty; `preset`: values instead of the declared initial ones
 */
export function formOf(
  kind,
  { given = {}, only = {}, offered = {}, needed = {}, preset = {} } = {},
) {
  const shown = app.forms[kind].filter((one) => !(one.name in given));
  const controls = shown.map((one) => {
    const key = keyOf(kind, one);
    const begins = preset[one.name] ?? (key === "card" ? cardInUse()?.name : one.begins);
    const id = `${kind}-${one.name.replaceAll("_", "-")}`;
    const names = (offered[one.offers] ?? []).map((name) => [literal(name), name]);
    const keeps = ([value]) => !(one.name in only) || only[one.name].includes(value);
    const options = [...one.choices, ...itemsOf(one), ...names].filter(keeps);
    const about = {
      ...one,
      key,
      id,
      begins,
      options,
      needed: needed[one.name],
      entry: chosen(key) ?? begins,
    };
    const { node, read } = controlOf(about);
    return {
      one,
      node: () => div({ class: isWide(one) ? "wide" : "", title: one.help }, node()),
      read,
    };
  });
  const folds = controls.filter(({ one }) => one.group === MORE).length > 2;
  const groupOf = ({ one }) => (one.group === MORE && !folds ? "" : one.group);
  const under = (group) =>
    controls.filter((one) => groupOf(one) === group).map(({ node }) => node());
  const groups = [...new Set(controls.map(groupOf))].filter((group) => group !== MORE);
  return {
    read: () => ({
      ...Object.fromEntries(controls.map(({ one, read }) => [one.name, read()])),
      ...given,
    }),
    pick: (names) =>
      controls.filter(({ one }) => names.includes(one.name)).map(({ node }) => node()),
    rest: (names) =>
      controls.filter(({ one }) => !names.includes(one.name)).map(({ node }) => node()),
    nodes: () =>
      groups.map((group) => [
        group && h3({ class: "gap" }, group),
        div({ class: "fields gap" }, under(group)),
      ]),
    more: (title = MORE) => folds && fold(title, div({ class: "fields" }, under(MORE))),
  };
}

const isWide = (one) =>
  one.many ||
  one.slider ||
  one.choices.length > 0 ||
  one.places.length > 0 ||
  ["yes", "text"].includes(one.type);

/** Return the control of a field: `{node(), read()}`. */
function controlOf(one) {
  const { key, id, entry, unit } = one;
  const change = (value) => choose({ [key]: value });
  if (one.word === "duty") return { node: () => dutyFields(id), read: readDuty };
  if (one.type === "yes") {
    return {
      node: () => check(one.label, Boolean(entry), change, { id }),
      read: () => Boolean(entry),
    };
  }
  if (one.many && one.places.includes("runs") && one.word !== "campaigns")
    return filesControl(one, change);
  if (one.many) return severalControl(one);
  if (one.choices.length || one.places.length) return choiceControl(one, change);
  const about = { unit, id, needed: one.needed, placeholder: one.none };
  if (one.slider) {
    const [min, max, step] = one.slider;
    const node = () => slider(one.label, entry ?? min, change, { unit, id, min, max, step });
    return { node, read: () => readNumber(one.label, entry, { otherwise: one.default }) };
  }
  if (one.type !== "text") {
    const read = () => readNumber(one.label, entry, { needed: one.needed, otherwise: one.default });
    return { node: () => numberField(one.label, entry, change, about), read };
  }
  const typed = (event) => change(event.target.value);
  const line = () =>
    input({
      type: "text",
      maxlength: 160,
      id,
      value: entry ?? "",
      placeholder: one.none,
      oninput: typed,
    });
  return {
    node: () => field(one.label, line(), { unit }),
    read: () => String(entry ?? "").trim() || one.default,
  };
}

function filesControl({ label: words, id, options, entry }, change) {
  const all = [["", "all runs in the folder"], ...options];
  const node = () =>
    field(
      words,
      select(all, entry?.[0] ?? "", (name) => change(name ? [name] : null), { id }),
    );
  return { node, read: () => entry ?? null };
}

function choiceControl(one, change) {
  const { id, word } = one;
  const isOptional = one.default === null;
  const named = new Map([
    ...(isOptional ? [["", one.required ? `choose a ${word}` : one.none || "none"]] : []),
    ...one.options,
  ]);
  const isOffered =
    named.has(one.entry) || (one.entry && one.places.length > 0 && !one.choices.length);
  let value = isOffered ? one.entry : named.has(one.begins) ? one.begins : [...named.keys()][0];
  if (one.required && !value) value = one.options[0]?.[0] ?? "";
  if (value && !named.has(value)) named.set(value, `${value} (deleted)`);
  const node = () => [
    field(one.label, select([...named], value, change, { id })),
    one.places.includes("inputs") && bringInput(`Bring a ${word}`, one.files, change),
  ];
  return { node, read: () => value || null };
}

/** Return the control of several values: check boxes, and a text field for other values. */
function severalControl(one) {
  const { key, id, options, type, free, places, label: words } = one;
  const names = options.map(([value]) => value);
  const many = type !== "text";
  const values = one.entry ?? (one.required ? names : []);
  const picked = values.filter((value) => names.includes(value));
  const rest = values.filter((value) => !names.includes(value));
  const typed = chosen(`${key}.text`) ?? (many ? textOf(rest) : rest.join(", "));
  const change = (value) => choose({ [key]: toggled(picked, value), [`${key}.text`]: typed });
  const write = (text) => choose({ [`${key}.text`]: text });
  const props = {
    id,
    placeholder: one.offers === "runs" ? "*_060C_*" : one.none,
    "aria-label": words,
  };
  const line = many
    ? numberInput(typed, write, { ...props, many })
    : input({
        ...props,
        type: "text",
        value: typed,
        oninput: (event) => write(event.target.value),
      });
  const boxes = options.map(([value, text]) =>
    check(text, picked.includes(value), () => change(value)),
  );
  const isLong = boxes.length > BOXES_MAX;
  const hint = one.none && !free ? `; without a choice: ${one.none}` : "";
  const node = () =>
    div(
      { role: "group", "aria-label": words },
      words !== one.group && span({ class: "small" }, words, one.unit && `, ${one.unit}`, hint),
      boxes.length > 0 && div({ class: isLong ? "picks" : "", ref: isLong ? rove : null }, boxes),
      free && line,
      places.includes("inputs") && bringInput(`Bring a ${one.word}`, one.files, change),
    );
  const texts = () => typed.split(/[,;]+/).map((text) => text.trim());
  const read = () => {
    const others = !free ? [] : many ? readNumber(words, typed, { many }) : texts().filter(Boolean);
    const all = [...new Set([...picked, ...others])];
    return all.length ? all : one.default;
  };
  return { node, read };
}

/** Return a button that uploads an input (a geometry, a table). */
export const bringInput = (words, suffixes, brought) =>
  p(
    { class: "small" },
    filePicker(`${words} (${suffixes.replaceAll(".", "").toUpperCase()})`, suffixes, ([file]) =>
      attempt(async () => {
        await putInput(file);
        await refresh(false);
        brought(file.name);
      }),
    ),
  );

/** Show the options of a job in its form. */
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

// ---------------------------------------------------------------------------------------------- load cycle

const SINE = /^sine:([-+\d.e]+)mm:([-+\d.e]+)Hz:([-+\d.e]+)([AV]):([-+\d.e]+)s$/;
const USUAL = { amplitude_mm: 15, frequency_Hz: 1, command: 2, duration_s: 1800 };

function sineOf(text) {
  const found = SINE.exec(text ?? "");
  const [amplitude_mm, frequency_Hz, command, , duration_s] = (found ?? []).slice(1).map(Number);
  return found && { amplitude_mm, frequency_Hz, command, duration_s };
}

/** Return the load cycle: the entries of the user, else a sine inside the range of the card in use. */
function dutyInUse() {
  const { command_unit: unit, envelope } = cardInUse() ?? {};
  const most = (values) => Math.max(...(values ?? [Infinity]).map(Math.abs));
  const amplitude_mm = Math.min(
    USUAL.amplitude_mm,
    Math.max(1, Math.floor(most(envelope?.displacement_mm))),
  );
  const speed_Hz = most(envelope?.velocity_mm_s) / (2 * Math.PI * amplitude_mm);
  const frequency_Hz = Math.min(USUAL.frequency_Hz, Math.max(0.1, Math.floor(10 * speed_Hz) / 10));
  const command = Math.min(USUAL.command, envelope?.command?.[1] ?? USUAL.command);
  const first = { ...USUAL, amplitude_mm, frequency_Hz, command };
  return { unit: unit ?? "A", most: envelope?.command?.[1] ?? 2, ...first, ...chosen("duty") };
}

/** Return the numbers of the sine. */
export function readSine() {
  const duty = dutyInUse();
  const names = {
    amplitude_mm: "Amplitude",
    frequency_Hz: "Frequency",
    command: "Command",
    duration_s: "Duration",
  };
  const read = ([name, words]) => [name, readNumber(words, duty[name], { otherwise: USUAL[name] })];
  return Object.fromEntries(Object.entries(names).map(read));
}

/** Return the load cycle as text: a sine, or the name of a table. */
function readDuty() {
  const { table, unit } = dutyInUse();
  if (table) return table;
  const { amplitude_mm, frequency_Hz, command, duration_s } = readSine();
  return `sine:${amplitude_mm}mm:${frequency_Hz}Hz:${command}${unit}:${duration_s}s`;
}

/** Return the fields of the load cycle. */
export function dutyFields(id) {
  const duty = dutyInUse();
  const change = (values) => choose({ duty: { ...chosen("duty"), ...values } });
  const one = (name, words, unit, [min, max, step]) =>
    slider(words, duty[name], (value) => change({ [name]: value }), {
      unit,
      min,
      max,
      step,
      id: `${id}-${name}`,
    });
  const tables = [["", "a sine"], ...inputsOf(".csv", ["duty"]).map((name) => [name, name])];
  return div(
    { class: "fields" },
    div(
      { class: "wide" },
      field(
        "Motion",
        select(tables, duty.table ?? "", (table) => change({ table }), { id }),
      ),
      bringInput("Bring a table", ".csv", (table) => change({ table })),
    ),
    !duty.table && [
      one("command", duty.unit === "V" ? "Voltage" : "Current", duty.unit, [
        0,
        Math.max(duty.most, 0.1),
        0.05,
      ]),
      one("amplitude_mm", "Amplitude", "mm", [1, 50, 1]),
      one("frequency_Hz", "Frequency", "Hz", [0.1, 5, 0.1]),
      one("duration_s", "Duration", "s", [300, 14400, 300]),
    ],
  );
}
