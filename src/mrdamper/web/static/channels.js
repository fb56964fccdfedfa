// Channel map of one file: role, unit and gain of each column. The file is read again after each change.

import { glance, look, putChannels } from "./api.js";
import { bytes, button, check, el, field, fill, fixed, note, number, numberField, select, svg, table } from "./dom.js";
import { findingTable, notes } from "./parts.js";
import { Plot } from "./plot.js";

const WAIT_MS = 350;
// Units of a gain, with their value in SI per volt.
const GAIN_UNITS = {
  displacement: [["mm/V", 1e-3], ["m/V", 1]],
  velocity: [["mm/s per V", 1e-3], ["m/s per V", 1]],
  force: [["kN/V", 1e3], ["N/V", 1]],
};
const MOST_CHOICES = 12;

/**
 * Return the sheet of a file: `{node, close()}`.
 *
 * @param {object} app
 * @param {string} name name of the file
 * @param {string[]} others files for which the same map can be saved
 * @param {{saved: () => void, close: () => void}} heard
 */
export function channelSheet(app, name, others, heard) {
  const body = el("div", {}, el("p", { class: "sub", text: `Reading ${name} …` }));
  const node = el("section", { class: "panel", id: "sheet", "aria-label": `Inside ${name}` }, body);
  let asked = new AbortController();
  let timer = null;
  const loop = new Plot({ title: "Loop of these columns", x: "displacement", y: "force", name: "columns", height: 240, bare: true });

  let whole = null; // Request for the complete file.
  let again = null; // Reads the file with the present entries.
  let head = false; // Only the beginning of a large file has been read.
  const failed = (fault) => {
    if (fault.name !== "AbortError") fill(body, note("fault", fault.message));
  };
  glance(name, asked.signal).then((found) => {
    drawn(found);
    head = found.head_share !== undefined;
    if (!head) return;
    let touched = false;
    body.addEventListener("input", () => (touched = true), { once: true });
    whole = new AbortController();
    look(name, whole.signal).then((all) => {
      head = false;
      if (touched) again?.(); // The entries stay and are applied to the complete file.
      else drawn(all);
    }, failed);
  }, failed);

  function drawn(found, offered = false) {
    const title = el("div", { class: "row" }, el("h2", { text: found.name }), button("Close", heard.close, { class: "quiet" }));
    if (!found.columns.length) {
      fill(body, title, note("fault", found.error ?? "nothing could be read"), el("p", { class: "small", text: "The file contains no table. Export it again from the software of the rig, or remove it." }));
      return;
    }
    const lines = found.columns.filter((column) => column.kind === "number").map((column) => columnLine(app, column, found));
    const texts = found.columns.filter((column) => column.kind === "text");
    const rest = restFields(found, texts);
    const preview = el("div", { "aria-live": "polite", id: "preview" });
    const same = others.map((other) => ({ other, ...check(other, false) }));
    const save = button("Save this map", () => keep(true), { class: "main", id: "save-map" });
    const take = button("Remove the map", () => drop(), { class: "danger" });
    take.hidden = !found.map || offered;

    const given = () => {
      const channel = {};
      for (const line of lines) Object.assign(channel, line.read());
      return { ...(Object.keys(channel).length ? { channel } : {}), ...rest.read() };
    };
    const files = () => [name, ...same.filter(({ box }) => box.checked).map(({ other }) => other)];
    again = () => keep(false);
    const tried = () => {
      drawLoop();
      clearTimeout(timer);
      timer = setTimeout(() => keep(false), WAIT_MS);
    };

    function drawLoop() {
      const [x, y] = ["displacement", "force"].map((role) => lines.find((line) => line.role.value === role));
      loop.node.hidden = !x || !y;
      if (!x || !y) return;
      Object.assign(loop.options, { x: x.label(), y: y.label() });
      try {
        loop.set({ series: [{ name: "loop", kind: "loop", x: x.values(), y: y.values(), colour: (colours) => colours.accent }] });
      } catch {
        loop.node.hidden = true; // A gain is missing or invalid; its field is marked.
      }
    }

    /** Apply the answer to a question of the reader. */
    function answer({ role, topic }, value) {
      if (topic === "column") lines.find(({ column }) => column.name === value)?.take(role);
      else if (topic === "unit") lines.find((line) => line.role.value === role)?.measure(value);
      else rest.set(topic === "rate" || topic === "part" ? topic : role, value);
      tried();
    }

    async function keep(saving) {
      asked.abort();
      asked = new AbortController();
      try {
        const told = await putChannels({ files: saving ? files() : [name], map: given(), save: saving, ...(head && !saving ? { head: true } : {}) }, asked.signal);
        fill(preview, told.previews.map((one) => previewOf(one, told.previews.length > 1, questions)));
        if (saving && told.saved) {
          app.toast("good", `The map of ${name} is saved.`);
          heard.saved();
          take.hidden = false;
        }
      } catch (fault) {
        if (fault.name !== "AbortError") fill(preview, note("fault", fault.message));
      }
    }

    async function drop() {
      await app.attempt(async () => {
        await putChannels({ files: [name], map: null, save: true });
        heard.saved();
        drawn(await look(name));
      });
    }

    const questions = (one) => (one.questions ?? []).map((question) => asking(app, question, (value) => answer(question, value)));
    const offers = (offered ? [] : found.offers ?? []).map((offer) =>
      button(`Use ${offer.name.replaceAll("_", " ")}: ${offer.runs} run${offer.runs === 1 ? "" : "s"}`, () => {
        drawn({ ...found, map: offer.map }, true);
        again();
      }, { class: "main" }));
    const columns = table(
      [
        { title: "column", class: "name", cell: ({ column }) => column.name || `column ${column.index}` },
        { title: "holds", cell: ({ column }) => el("span", {}, thumb(column.thumbnail), el("span", { class: "small", text: `${number(column.least, 4)} to ${number(column.most, 4)} ${column.unit ?? ""}` })) },
        { title: "is", cell: (line) => line.role },
        { title: "in", cell: (line) => line.unit },
        { title: "gain", cell: (line) => line.gain },
        { title: "turned", cell: (line) => line.turned },
      ],
      lines,
      { caption: "Columns that hold numbers" },
    );
    columns.querySelector("table").classList.add("sheet");
    columns.addEventListener("change", tried);
    columns.addEventListener("input", tried);
    rest.node.addEventListener("input", tried);

    fill(
      body,
      title,
      el("p", { class: "small", text: found.understood ?? "" }),
      offers.length > 0 && note("info", "A known map can read this file. ", el("span", { class: "row" }, offers)),
      columns,
      loop.node,
      el("details", {}, el("summary", { text: "First rows" }), firstRows(found)),
      el("h3", { text: "Values that the file does not contain" }),
      rest.node,
      same.length > 0 && el("details", {}, el("summary", { text: "Save the same map for other files" }), el("div", { class: "picks" }, same.map((one) => one.node))),
      el("div", { class: "actions" }, save, take),
      el("h3", { class: "gap", text: "With these channels" }),
      preview,
    );
    fill(preview, previewOf(found, false, questions));
    drawLoop();
  }

  return {
    node,
    close() {
      asked.abort();
      whole?.abort();
      clearTimeout(timer);
      loop.close();
    },
  };
}

/** Return the controls of a column: role, unit, gain and sign. */
function columnLine(app, column, found) {
  const roles = app.state.choices.roles;
  const mapped = Object.entries(found.map?.channel ?? {}).find(([, told]) => told.name === column.name || told.index === column.index);
  const current = mapped?.[0] ?? column.role ?? column.guess?.role ?? "";
  const told = mapped?.[1] ?? {};
  const label = column.name || `column ${column.index}`;
  const role = select([["", "not used"], ...roles.map((one) => [one.role, one.role])], current, { "aria-label": `${label} is`, "data-column": String(column.index) });
  const unit = select([], "", { "aria-label": `${label} in` });
  const gain = numberField(`${label} gain`, "", null, { "aria-label": `${label} gain`, placeholder: "–" });
  const gainUnits = (about) => (about ? GAIN_UNITS[about.role] ?? [[`${about.unit}/V`, 1]] : []);
  const scale = () => gainUnits(roles.find((one) => one.role === role.value)).find(([name]) => name === unit.value)?.[1];
  const turned = check("", told.sign === -1, { "aria-label": `${label} turned` });
  const units = (chosen) => {
    const about = roles.find((one) => one.role === role.value);
    const before = chosen ?? unit.value;
    const listed = about ? about.units.map((each) => [each, each]) : [];
    for (const [name] of gainUnits(about)) listed.push([name, `V, gain in ${name}`]);
    if (about && !listed.some(([value]) => value === before)) listed.unshift(["", "which unit?"]);
    fill(unit, listed.map(([value, text]) => el("option", { value, text, selected: value === before })));
    unit.disabled = !about;
    gain.input.disabled = !scale();
    gain.require(scale() ? `enter how many ${unit.value.replace(/(\/| per )V$/, "")} are one volt.` : "");
    turned.box.disabled = !about;
  };
  const [firstUnit, firstScale] = gainUnits(roles.find((one) => one.role === role.value))[0] ?? [];
  const hasGain = told.gain !== undefined && firstUnit;
  if (hasGain) gain.set(Number((told.gain / firstScale).toPrecision(12)));
  units(hasGain ? firstUnit : told.unit ?? column.guess?.unit ?? column.unit);
  role.addEventListener("change", () => units(column.guess?.role === role.value ? column.guess.unit : column.unit));
  unit.addEventListener("change", () => units());
  const unique = column.name && found.columns.filter((other) => other.name === column.name).length === 1;
  return {
    column,
    role,
    unit,
    gain: gain.input,
    turned: turned.node,
    label: () => `${role.value}${scale() ? `, ${roles.find((one) => one.role === role.value).unit}` : unit.value ? `, ${unit.value}` : ""}`,
    /** Return the values of the quick loop. */
    values() {
      const factor = (turned.box.checked ? -1 : 1) * (scale() ? scale() * gain.read() : 1);
      return (column.sample ?? []).map((value) => (value === null ? NaN : factor * value));
    },
    take(wanted) {
      role.value = wanted;
      units(column.guess?.role === wanted ? column.guess.unit : column.unit);
    },
    measure: (wanted) => units(wanted === "V" ? gainUnits(roles.find((one) => one.role === role.value))[0][0] : wanted),
    read() {
      if (!role.value) return {};
      const entry = unique ? { name: column.name } : { index: column.index };
      if (scale()) {
        entry.unit = "V";
        entry.gain = Number((scale() * gain.read()).toPrecision(12));
      } else if (unit.value) entry.unit = unit.value;
      if (told.offset) entry.offset = told.offset;
      if (turned.box.checked) entry.sign = -1;
      return { [role.value]: entry };
    },
  };
}

/** Return the fields of constants and segments, and the function that reads them. */
function restFields(found, texts) {
  const map = found.map ?? {};
  let file = map.file;
  const constant = map.constant ?? {};
  const current = numberField("Coil current", "A", constant.current_A, { placeholder: "in the file" });
  const voltage = numberField("Coil voltage", "V", constant.voltage_V, { placeholder: "in the file" });
  const warmth = numberField("Temperature", "°C", constant.temperature_degC, { placeholder: "not known" });
  const rate = numberField("Sampling rate", "Hz", constant.rate_Hz, { placeholder: "in the file" });
  const words = el("input", { type: "text", value: map.segments?.split ?? "", placeholder: "one test" });
  const levels = numberField("Currents of the tests", "A", map.segments?.current_A ?? map.segments?.voltage_V ?? [], { list: true, empty: [], placeholder: "0; 0.25; 0.5" });
  const session = el("input", { type: "text", value: map.session?.name ?? "", placeholder: "this file" });
  const node = el(
    "div",
    {},
    el(
      "div",
      { class: "fields" },
      current.node,
      voltage.node,
      warmth.node,
      rate.node,
      field("Session", session, { hint: "runs that share one tare" }),
      texts.length > 0 && field("A new test begins at", words, { hint: `a word in ${texts.map((one) => one.name || `column ${one.index}`).join(", ")}` }),
      texts.length > 0 && levels.node,
    ),
  );
  return {
    node,
    /** Fill the field of a constant, from an answer such as `0.5 A`. */
    set(what, value) {
      if (what === "part") file = { ...file, common_time: value === "common" };
      const one = { current, voltage, temperature: warmth, rate }[what];
      if (one) one.set(parseFloat(value));
    },
    read() {
      const told = {};
      for (const [key, one] of [["current_A", current], ["voltage_V", voltage], ["temperature_degC", warmth], ["rate_Hz", rate]]) {
        if (one.read() !== null) told[key] = one.read();
      }
      const made = Object.keys(told).length ? { constant: told } : {};
      const numbers = levels.read();
      if (words.value && numbers.length) made.segments = { split: words.value, [map.segments?.voltage_V ? "voltage_V" : "current_A"]: numbers };
      if (session.value) made.session = { name: session.value };
      if (file) made.file = file;
      return made;
    },
  };
}

/** Return a question of the reader with its possible answers. */
function asking(app, question, answered) {
  const { role, topic, candidates } = question;
  const units = topic === "unit" ? app.state.choices.roles.find((one) => one.role === role)?.units ?? [] : [];
  const offered = candidates.length ? candidates : units;
  const choices = topic === "unit" ? [...offered, "V"] : offered;
  const said = { column: `Which column is the ${role}?`, unit: `In which unit is the ${role}?`, rate: "How many samples a second?", value: `What was the ${role}?`, scale: `How much ${role} is one volt?`, part: "Which part of the time?" }[topic];
  return el("div", { class: "notice warning" }, el("b", { text: said }), " ", choices.length ? el("span", { class: "row" }, choices.slice(0, MOST_CHOICES).map((value) => button(value, () => answered(value), { "aria-label": `${said} ${value}` }))) : "Fill it in above.");
}

/** Return the runs of a file with a map, or its errors; `questions` returns the open questions. */
function previewOf(found, named, questions) {
  const head = named && el("h3", { text: found.name });
  const runs = found.runs ?? [];
  return el(
    "div",
    {},
    head,
    questions(found),
    found.error && (found.questions?.length ? el("details", {}, el("summary", { text: "In full" }), note("fault", found.error)) : note("fault", found.error)),
    found.head_share !== undefined && note("info", `Seen so far: the first ${number(100 * found.head_share, 2)} % of ${bytes(found.bytes)}. Its runs are made when all of it has been read.`),
    runs.length > 0 && !found.error && note(runs.some((run) => run.error) ? "warning" : "good", `${runs.length} run${runs.length > 1 ? "s" : ""}${runs.some((run) => run.error) ? `, ${runs.filter((run) => run.error).length} not usable` : ""}: ${runs.map((run) => run.name).join(", ")}`),
    runs.length > 0 &&
      notes(
        runs.map((run) =>
          `${run.name}: ${run.motion || "no motion recognised"}, ${run.command === null ? "varying command" : `${fixed(run.command, 2)} ${run.command_unit}`}, ${number(run.stroke_mm)} mm stroke, ${run.force_range_N ? `${fixed(run.force_range_N[0], 0)} to ${fixed(run.force_range_N[1], 0)} N` : "no force"}${run.error ? `: ${run.error}` : ""}`,
        ),
      ),
    (found.findings ?? []).length > 0 && el("details", {}, el("summary", { text: `${found.findings.length} findings` }), findingTable(found.findings)),
  );
}

function firstRows(found) {
  const count = Math.max(...found.columns.map((column) => column.first?.length ?? 0));
  const made = table(
    found.columns.map((column) => ({ title: column.name || `column ${column.index}`, unit: column.unit, number: column.kind === "number", cell: (k) => told(column.first?.[k]) })),
    [...Array(count).keys()],
    { caption: found.rows === null ? `The first ${count} rows` : `The first ${count} of ${found.rows} rows` },
  );
  made.querySelector("table").classList.add("sheet");
  return made;
}

const told = (value) => (typeof value === "number" ? number(value, 6) : value);

/** Return a small picture of a column. */
function thumb(values) {
  const known = (values ?? []).filter((value) => Number.isFinite(value));
  if (known.length < 2) return null;
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const span = high - low || 1;
  const path = values
    .map((value, k) => `${k ? "L" : "M"}${((k / (values.length - 1)) * 100).toFixed(1)} ${(27 - (24 * ((value ?? low) - low)) / span).toFixed(1)}`)
    .join("");
  return svg("svg", { class: "thumb", viewBox: "0 0 100 30", preserveAspectRatio: "none", "aria-hidden": "true" }, svg("path", { d: path, "vector-effect": "non-scaling-stroke" }));
}
