// Forms of jobs, built from the declared fields (/api/forms). No option is declared here.

import { putInput } from "./api.js";
import { button, check, el, field as labelled, filePicker, fill, numberField, rove, select } from "./dom.js";

const MORE = "More";
const FOLDED = 2; // More rarely changed fields than this are folded.
const FEW = 6; // More boxes than this are in a scrolled list.
const SHARED = ["drawing", "duty", "controller"]; // Choices that all pages share.

/**
 * Return the form of a kind of job.
 *
 * @param {object} app
 * @param {string} kind
 * @param {{given?: object, offered?: object, only?: object, changed?: () => void, slots?: object}} how
 *   given: values that the page sets; offered: names by kind of offer (`runs`); only: the choices that a field keeps;
 *   slots: controls of the page `{node, read, set}` by kind of field (`duty`); changed: called after a field was changed
 */
export function jobForm(app, kind, { given = {}, offered = {}, only = {}, slots = {}, changed = null } = {}) {
  const controls = new Map();
  const fields = app.forms[kind].map((one) => (one.name in only ? narrowed(one, only[one.name]) : one));
  const folds = fields.filter((one) => one.group === MORE).length > FOLDED;
  for (const one of fields.map((each) => (folds || each.group !== MORE ? each : { ...each, group: "" }))) {
    if (one.name in given) continue;
    const made = slots[one.word] ?? controlOf(app, one, `${kind}-${one.name.replaceAll("_", "-")}`, offered);
    if (one.help) made.node.title ||= one.help;
    const shared = SHARED.find((choice) => [one.word, one.name].includes(choice));
    made.node.addEventListener("input", () => {
      changed?.(one.name);
      try {
        const value = made.read();
        app.keepField(kind, one.name, value);
        if (shared && value) app.choose(shared, value);
      } catch {
        // An invalid entry is marked in its field and is not stored.
      }
    });
    controls.set(one.name, { ...made, one, shared, initial: shared && made.read() });
  }
  const under = (group) => [...controls.values()].filter(({ one }) => one.group === group).map(({ node }) => node);
  const groups = [...new Set([...controls.values()].map(({ one }) => one.group))].filter((group) => group !== MORE);

  const form = {
    /** Return the options of the form and the values that the page sets; throw an error for an invalid entry. */
    read: () => ({ ...Object.fromEntries([...controls].map(([name, control]) => [name, control.read()])), ...given }),

    /** Show other values; names without a field are ignored. */
    set(values) {
      for (const [name, value] of Object.entries(values ?? {})) controls.get(name)?.set(value);
    },

    /** Take over the choices that were made on any page; a choice that this form alone has made is shared. */
    share() {
      for (const { shared, initial, set, read, has } of controls.values()) {
        if (!shared) continue;
        const choice = app.chosen(shared);
        if (choice && (has?.(choice) ?? true)) set(choice);
        else if (!choice && read() !== initial) app.choose(shared, read());
      }
    },

    /** Set a field like a change by the user. */
    async restore(name, value) {
      controls.get(name)?.set(value);
      if (controls.has(name)) await changed?.(name);
    },

    /** Show the values of a geometry; options of missing parts are disabled. */
    follow(facts) {
      this.set(Object.fromEntries(Object.entries(facts).filter(([, value]) => typeof value !== "object")));
      for (const { one, input, set } of controls.values()) {
        if (!one.part) continue;
        input.disabled = facts[one.part] === null;
        set(!input.disabled);
      }
    },

    /** Return the control of a field: `{node, read(), set(value), input}`. */
    control: (name) => controls.get(name),

    /** Offer new items of the folder. */
    draw() {
      for (const control of controls.values()) control.draw?.();
    },

    /** Replace the names of an offer. */
    offer(what, names) {
      offered[what] = names;
      for (const control of controls.values()) if (control.one.offers === what) control.offer(names);
    },

    /** Return the fields of a group, or of all groups except "More". */
    nodes: (group = null) =>
      (group === null ? groups : [group]).map((each) => [
        each && each !== MORE && el("h3", { class: "gap", text: each }),
        el("div", { class: "fields gap" }, under(each)),
      ]),

    /** Return the rarely changed fields in a fold. */
    more: (title = MORE, props = {}, ...first) =>
      under(MORE).length > 0 && el("details", props, el("summary", { text: title }), el("div", { class: "fields" }, first, under(MORE))),

    /** Return the form as a panel with a button. */
    panel(label, start, ...first) {
      return el("form", { class: "panel", "aria-label": label, onsubmit: (event) => event.preventDefault() }, first, this.nodes(), this.more(), el("div", { class: "actions" }, start));
    },
  };
  form.share();
  app.remember(kind, form);
  return form;
}

/** Return a field that offers only some of its choices: nothing else is preset or sent. */
function narrowed(one, names) {
  const choices = one.choices.filter(([value]) => names.includes(value));
  const begins = [one.begins].flat().filter((value) => names.includes(value));
  const first = begins.length ? begins : names.slice(0, 1);
  return { ...one, choices, ...(one.many ? { begins: first, default: names } : { begins: first[0], default: first[0] }) };
}

/** Return the control of a field: its node, and functions that read and set it. */
function controlOf(app, one, id, offered) {
  if (one.word === "duty") return dutyControl(app, one, id);
  if (one.slider) return sliderControl(one, id);
  if (one.type === "yes") return checkControl(one, id);
  if (one.many) return one.places.includes("runs") && one.word !== "campaigns" ? filesControl(app, one, id) : severalControl(app, one, id, offered);
  if (one.choices.length || one.places.length) return choiceControl(app, one, id);
  return textControl(one, id);
}

function textControl(one, id) {
  if (one.type !== "text") {
    return numberField(one.label, one.unit, one.begins, { empty: one.default, id, placeholder: one.none });
  }
  const input = el("input", { type: "text", maxlength: 160, id, value: one.begins ?? "", placeholder: one.none });
  return {
    node: labelled(one.label, input, { unit: one.unit, wide: true }),
    input,
    read: () => input.value.trim() || one.default,
    set: (value) => (input.value = value ?? ""),
  };
}

function checkControl(one, id) {
  const { box, node } = check(one.label, Boolean(one.begins), { id });
  node.classList.add("wide");
  return { node, input: box, read: () => box.checked, set: (value) => (box.checked = Boolean(value)) };
}

function sliderControl(one, id) {
  const [min, max, step] = one.slider;
  return slider(one.label, one.unit, one.begins ?? min, { min, max, step, decimals: step < 1 ? 1 : 0, id });
}

/** Return a slider with its label and value; `told` is called while it moves. */
export function slider(label, unit, value, { min, max, step, decimals = 0, id = null }, told = () => {}) {
  const input = el("input", { type: "range", min, max, step, id: id ?? `s-${label.replaceAll(" ", "-").toLowerCase()}` });
  input.value = value; // The bounds must be set first, because the browser clips the value.
  const output = el("output", { for: input.id });
  const say = () => {
    const shown = Number(input.value).toFixed(decimals);
    output.textContent = `${(Number(shown) === Number(input.value) ? shown : input.value).replace("-", "−")} ${unit}`;
    input.setAttribute("aria-valuetext", output.textContent);
  };
  input.addEventListener("input", () => {
    say();
    told();
  });
  say();
  return {
    input,
    node: el("div", { class: "slider wide" }, el("label", { for: input.id, text: label }), output, input),
    read: () => Number(input.value),
    set(next) {
      if (next === null || next === undefined) return;
      Object.assign(input, { min: Math.min(min, next), max: Math.max(max, next), step }); // A value is never clipped or rounded.
      input.value = next;
      if (Number(input.value) !== Number(next)) Object.assign(input, { step: "any", value: next });
      say();
    },
  };
}

/** Return the items of the folder that a field offers, as `[value, text]` pairs. */
function thingsFor(app, one) {
  const { state } = app;
  const found = {
    inputs: () => inputsOf(app, one.files, one.looks).map((name) => [name, name]),
    cards: () => cardsOf(app).map((card) => [card.name, `${card.name} (${card.law})`]),
    records: () => state.records.map((file) => [file.name, file.name]),
    runs: () => state.files.map((file) => [file.name, file.name]),
    maps: () => state.files.filter((file) => file.mapped).map((file) => [file.name, `as for ${file.name}`]),
  };
  return one.places.flatMap((place) => found[place]());
}

/** Return cards that can be read. */
export const cardsOf = (app) => app.state.cards.filter((card) => !card.error);

/** Return the names of inputs with a suffix and one of some kinds; inputs of unknown kind are included. */
export const inputsOf = (app, suffix, kinds) =>
  app.state.inputs.filter((input) => input.name.endsWith(suffix) && (!kinds.length || !input.kind || kinds.includes(input.kind))).map((input) => input.name);

function choiceControl(app, one, id) {
  const optional = one.default === null;
  const list = select([], "", { id });
  const draw = (chosen) => {
    const named = new Map([...(optional ? [["", one.required ? `choose a ${one.word}` : one.none || "none"]] : []), ...one.choices, ...thingsFor(app, one)]);
    if (chosen && !named.has(chosen)) named.set(chosen, `${chosen} (deleted)`);
    fill(list, [...named].map(([value, text]) => el("option", { value, text, selected: value === (chosen ?? "") })));
  };
  draw(one.begins ?? (one.required ? thingsFor(app, one)[0]?.[0] : null));
  const take = (name) => {
    draw(name);
    list.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const brings = one.places.includes("inputs");
  return {
    node: el("div", { class: "wide" }, labelled(one.label, list), brings && inputPicker(app, `Bring a ${one.word} (${one.files.slice(1).toUpperCase()})`, one.files, take),
      one.word === "drawing" && el("p", { class: "small" }, el("a", { href: "#/drawing", text: "Enter your own geometry" }))),
    input: list,
    read: () => list.value || null,
    set: draw,
    has: (value) => thingsFor(app, one).concat(one.choices).some(([name]) => name === value),
    draw: () => draw(list.value),
  };
}

/** Return check boxes, and a text field for other values. */
function severalControl(app, one, id, offered) {
  const boxes = new Map();
  const picks = el("div", { class: "picks" });
  const settle = rove(picks);
  const numeric = one.type !== "text";
  const props = { id, placeholder: one.offers === "runs" ? "*_060C_*" : one.none, "aria-label": one.label };
  const numbers = numeric && numberField(one.label, "", [], { ...props, list: true, empty: [] });
  const line = numbers ? numbers.input : el("input", { type: "text", ...props });
  const add = (value, text, on) => {
    if (!boxes.has(value)) boxes.set(value, check(text, on));
    boxes.get(value).box.checked = on;
  };
  const draw = () => {
    fill(picks, [...boxes.values()].map(({ node }) => node));
    picks.hidden = boxes.size === 0;
    picks.className = boxes.size > FEW ? "picks" : "";
    settle();
  };
  const offer = (names) => {
    boxes.clear();
    for (const [value, text] of [...one.choices, ...thingsFor(app, one), ...names.map((name) => [literal(name), name])]) add(value, text, false);
    draw();
  };
  const set = (values) => {
    for (const { box } of boxes.values()) box.checked = false;
    const rest = [];
    for (const value of values ?? []) {
      if (boxes.has(value)) boxes.get(value).box.checked = true;
      else if (one.free) rest.push(value);
    }
    if (numbers) numbers.set(rest);
    else line.value = rest.join(", ");
  };
  offer(offered[one.offers] ?? []);
  set(one.begins ?? (one.required ? [...boxes.keys()] : []));
  const brought = (name) => {
    add(name, name, true);
    draw();
  };
  const typed = () => (numbers ? numbers.read() : line.value.split(/[,;]+/).map((text) => text.trim()).filter(Boolean));
  const brings = one.places.includes("inputs");
  return {
    node: el("div", { class: "wide", role: "group", "aria-label": one.label },
      one.label !== one.group && el("span", { class: "small", text: `${one.label}${one.unit ? `, ${one.unit}` : ""}${one.none && !one.free ? `; without a choice: ${one.none}` : ""}` }),
      picks, one.free && line, brings && inputPicker(app, `Bring a ${one.word} (${one.files.slice(1).toUpperCase()})`, one.files, brought)),
    input: line,
    draw() {
      for (const [value, text] of thingsFor(app, one)) if (!boxes.has(value)) add(value, text, one.required);
      draw();
    },
    read() {
      const values = [...[...boxes].filter(([, { box }]) => box.checked).map(([value]) => value), ...(one.free ? typed() : [])];
      return values.length ? [...new Set(numeric ? values.map(Number) : values)] : one.default;
    },
    set,
    offer,
  };
}

/** Return a pattern that matches a name literally. */
export const literal = (name) => name.replace(/[[*?]/g, (sign) => `[${sign}]`);

/** Return the choice of one file of runs, or all. */
function filesControl(app, one, id) {
  const list = select([["", "all runs in the folder"], ...thingsFor(app, one)], "", { id });
  return { node: labelled(one.label, list), input: list, read: () => (list.value ? [list.value] : null), set: (names) => (list.value = names?.length === 1 ? names[0] : "") };
}

const SINE = /^sine:([-+\d.e]+)mm:([-+\d.e]+)Hz:([-+\d.e]+)([AV]):([-+\d.e]+)s$/;

/** Return the values of a sine text, `{amplitude_mm, frequency_Hz, command, unit, duration_s}`; null for another text. */
export function sineOf(text) {
  const found = SINE.exec(text ?? "");
  return found && { amplitude_mm: Number(found[1]), frequency_Hz: Number(found[2]), command: Number(found[3]), unit: found[4], duration_s: Number(found[5]) };
}

/** Return the text of a sine as a load cycle. */
export const dutyText = ({ amplitude_mm, frequency_Hz, command, unit, duration_s }) => `sine:${amplitude_mm}mm:${frequency_Hz}Hz:${command}${unit}:${duration_s}s`;

/** Return the choice of a table with a load cycle. */
export const tableChoice = (app, label, none, id) =>
  choiceControl(app, { label, none, default: null, choices: [], places: ["inputs"], files: ".csv", looks: ["duty"], word: "table" }, id);

/** Return the sine that a load cycle begins with: inside the range of the card in use, in its unit. */
export function firstSine(app, text) {
  const { command_unit: unit = "A", envelope } = app.state.cards.find((card) => card.name === app.chosen("card")) ?? {};
  const sine = { ...sineOf(text), unit };
  const stroke = Math.max(...(envelope?.displacement_mm ?? [Infinity]).map(Math.abs));
  sine.command = Math.min(sine.command, envelope?.command?.[1] ?? sine.command);
  sine.amplitude_mm = Math.min(sine.amplitude_mm, Math.max(1, Math.floor(stroke)));
  const speed = Math.max(...(envelope?.velocity_mm_s ?? [Infinity]).map(Math.abs));
  sine.frequency_Hz = Math.min(sine.frequency_Hz, Math.max(0.1, Math.floor((10 * speed) / (2 * Math.PI * sine.amplitude_mm)) / 10));
  return sine;
}

/** Return the choice of a load cycle: a sine, or a table; the command of the sine has the unit of the card in use. */
function dutyControl(app, one, id) {
  const usual = firstSine(app, one.default);
  const table = tableChoice(app, "Motion", "a sine", id);
  const numbers = [["amplitude_mm", "Amplitude", "mm"], ["frequency_Hz", "Frequency", "Hz"], ["command", usual.unit === "V" ? "Voltage" : "Current", usual.unit], ["duration_s", "Duration", "s"]]
    .map(([name, label, unit]) => [name, textControl({ label, unit, type: "number", least: 0, most: null, begins: usual[name], none: "", default: usual[name] }, `${id}-${name}`)]);
  const fields = el("div", { class: "fields wide" }, numbers.map(([, { node }]) => node));
  table.input.addEventListener("input", () => (fields.hidden = Boolean(table.read())));
  return {
    node: el("div", { class: "wide" }, table.node, fields),
    input: table.input,
    read: () => table.read() ?? dutyText({ unit: usual.unit, ...Object.fromEntries(numbers.map(([name, control]) => [name, control.read()])) }),
    set(text) {
      const sine = sineOf(text);
      table.set(sine ? null : text);
      fields.hidden = !sine;
      for (const [name, control] of numbers) if (sine && (name !== "command" || sine.unit === usual.unit)) control.set(sine[name]);
    },
  };
}

/** Return a button that uploads an input (a geometry, a table). */
export function inputPicker(app, label, accept, brought) {
  const { picker, pick } = filePicker(accept, ([file]) =>
    app.attempt(async () => {
      await putInput(file);
      await app.refresh();
      brought(file.name);
    }));
  return el("p", { class: "small" }, button(label, pick, { class: "quiet" }), picker);
}
