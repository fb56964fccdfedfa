// Channel map of one file: role, unit and gain of each column. The file is read again after each change.

import { glance, look, putChannels } from "./api.js";
import { numberField, numberInput, readNumber } from "./forms.js";
import { findingList } from "./jobs.js";
import { plot } from "./plot.js";
import { app, attempt, toast } from "./state.js";
import {
  button,
  bytes,
  check,
  field,
  fixed,
  fold,
  note,
  notes,
  number,
  select,
  several,
  table,
  tags,
  toggled,
} from "./ui.js";
import { h, useEffect, useMemo, useRef, useState } from "./vendor/preact.js";

const { b, div, h2, h3, input, p, path, section, small, span, svg } = tags;
const WAIT_MS = 350;
const ANSWERS_MAX = 12;
// Units of a gain, with their value in SI per volt.
const GAIN_UNITS = {
  displacement: [
    ["mm/V", 1e-3],
    ["m/V", 1],
  ],
  velocity: [
    ["mm/s per V", 1e-3],
    ["m/s per V", 1],
  ],
  force: [
    ["kN/V", 1e3],
    ["N/V", 1],
  ],
};
const CONSTANTS = [
  ["current_A", "Coil current", "A", "in the file"],
  ["voltage_V", "Coil voltage", "V", "in the file"],
  ["temperature_degC", "Temperature", "°C", "not known"],
  ["rate_Hz", "Sampling rate", "Hz", "in the file"],
];

const roleOf = (name) => app.state.choices.roles.find(({ role }) => role === name);
const gainUnits = (role) => (role ? (GAIN_UNITS[role] ?? [[`${roleOf(role).unit}/V`, 1]]) : []);
const scaleOf = ({ role, unit }) => gainUnits(role).find(([name]) => name === unit)?.[1];
const labelOf = ({ name, index }) => name || `column ${index}`;
const rounded = (value) => Number(value.toPrecision(12));
const neededFor = (unit) => `enter how many ${unit.replace(/(\/| per )V$/, "")} are one volt.`;

// ------------------------------------------------------------------------------------------------- entries

/** Return the entries of the sheet: `{columns: {index: {role, unit, gain, sign, offset}}, rest}`. */
function entriesOf({ columns, map }) {
  const one = (column) => {
    const isMapped = ([, told]) => told.name === column.name || told.index === column.index;
    const [role = column.role ?? column.guess?.role ?? "", told = {}] =
      Object.entries(map?.channel ?? {}).find(isMapped) ?? [];
    const [[unit, scale] = []] = gainUnits(role);
    const gain = told.gain === undefined ? {} : { unit, gain: rounded(told.gain / scale) };
    const { sign = 1, offset } = told;
    return [
      column.index,
      { role, unit: told.unit ?? column.guess?.unit ?? column.unit ?? "", sign, offset, ...gain },
    ];
  };
  const { constant = {}, segments = {}, session = {}, file } = map ?? {};
  const levels = segments.current_A ?? segments.voltage_V ?? [];
  const kind = segments.voltage_V ? "voltage_V" : "current_A";
  return {
    columns: Object.fromEntries(columns.filter(({ kind: type }) => type === "number").map(one)),
    rest: {
      ...constant,
      split: segments.split ?? "",
      levels,
      kind,
      session: session.name ?? "",
      file,
    },
  };
}

const gainOf = (column, one) =>
  scaleOf(one) * readNumber(`${labelOf(column)} gain`, one.gain, { needed: neededFor(one.unit) });

/** Return the channel map of the entries; an invalid number throws an error. */
function mapOf({ columns: entries, rest }, { columns }) {
  const map = {};
  const channel = {};
  for (const column of columns) {
    const one = entries[column.index];
    if (!one?.role) continue;
    const isUnique = column.name && columns.filter(({ name }) => name === column.name).length === 1;
    const entry = isUnique ? { name: column.name } : { index: column.index };
    if (scaleOf(one)) Object.assign(entry, { unit: "V", gain: rounded(gainOf(column, one)) });
    else if (one.unit) entry.unit = one.unit;
    if (one.offset) entry.offset = one.offset;
    if (one.sign === -1) entry.sign = -1;
    channel[one.role] = entry;
  }
  if (Object.keys(channel).length) map.channel = channel;
  const constants = CONSTANTS.map(([key, words]) => [key, readNumber(words, rest[key])]).filter(
    ([, value]) => value !== null,
  );
  if (constants.length) map.constant = Object.fromEntries(constants);
  const levels = readNumber("Currents of the tests", rest.levels, { many: true });
  if (rest.split && levels.length) map.segments = { split: rest.split, [rest.kind]: levels };
  if (rest.session) map.session = { name: rest.session };
  if (rest.file) map.file = rest.file;
  return map;
}

// --------------------------------------------------------------------------------------------------- sheet

/**
 * Sheet of a file.
 *
 * @param {{name: string, others: string[], close: () => void}} props others: files for which the map can be saved, too
 */
export function ChannelSheet({ name, others, close }) {
  const [found, setFound] = useState(null);
  const [entry, setEntry] = useState(null);
  const [told, setTold] = useState({ previews: [] }); // Answer to the present entries.
  const [fault, setFault] = useState("");
  const [same, setSame] = useState([]);
  const touched = useRef(false);
  const show = (next, map = next.map) => {
    setFound(next);
    setEntry(entriesOf({ ...next, map }));
    setTold({ previews: [next] });
  };
  const change = (next) => {
    touched.current = true;
    setEntry({ ...entry, ...next });
  };

  useEffect(() => {
    const asked = new AbortController();
    const failed = ({ name: kind, message }) => kind !== "AbortError" && setFault(message);
    glance(name, asked.signal)
      .then(async (beginning) => {
        show(beginning);
        if (beginning.head_share === undefined) return;
        const whole = await look(name, asked.signal); // Only the beginning of the large file was read.
        if (touched.current) setFound(whole);
        else show(whole);
      })
      .catch(failed);
    return () => asked.abort();
  }, [name]);

  useEffect(() => {
    if (!touched.current) return undefined;
    const asked = new AbortController();
    const timer = setTimeout(() => send(false, [name], asked.signal), WAIT_MS);
    return () => (clearTimeout(timer), asked.abort());
  }, [entry, found]);

  async function send(save, files, signal) {
    try {
      const head = found.head_share !== undefined && !save ? { head: true } : {};
      const answer = await putChannels({ files, map: mapOf(entry, found), save, ...head }, signal);
      setTold(answer);
      setFault("");
      if (!answer.saved) return;
      toast("good", `The map of ${name} is saved.`);
      setFound({ ...found, map: {} });
    } catch (error) {
      if (error.name !== "AbortError") setFault(error.message);
    }
  }
  const drop = async () => {
    await putChannels({ files: [name], map: null, save: true });
    touched.current = false;
    show(await look(name));
  };

  const title = div({ class: "row" }, h2(name), button("Close", close, { class: "quiet" }));
  const frame = (...body) =>
    section({ class: "panel", id: "sheet", "aria-label": `Inside ${name}` }, title, body);
  if (!found) return frame(fault ? note("fault", fault) : p({ class: "sub" }, `Reading ${name} …`));
  const remedy =
    "The file contains no table. Export it again from the software of the rig, or remove it.";
  if (!found.columns.length)
    return frame(
      note("fault", found.error ?? "Nothing could be read."),
      p({ class: "small" }, remedy),
    );

  const columns = found.columns.filter(({ kind }) => kind === "number");
  const set = (index, values) =>
    change({ columns: { ...entry.columns, [index]: { ...entry.columns[index], ...values } } });
  const setRest = (values) => change({ rest: { ...entry.rest, ...values } });
  const take = (column, role) => {
    const unit = column.guess?.role === role ? column.guess.unit : column.unit;
    set(column.index, { role, unit: unit ?? "" });
  };
  const answered = ({ role, topic }, value) => {
    const column = columns.find(({ index }) => entry.columns[index].role === role);
    if (topic === "column")
      take(
        columns.find((one) => one.name === value),
        role,
      );
    else if (topic === "unit")
      set(column?.index, { unit: value === "V" ? gainUnits(role)[0][0] : value });
    else if (topic === "part")
      setRest({ file: { ...entry.rest.file, common_time: value === "common" } });
    else {
      const key =
        topic === "rate"
          ? "rate_Hz"
          : CONSTANTS.find(([, words]) => words.toLowerCase().includes(role))?.[0];
      setRest({ [key]: parseFloat(value) });
    }
  };
  const offers = touched.current ? [] : (found.offers ?? []);
  const offer = (one) =>
    button(
      `Use ${one.name.replaceAll("_", " ")}: ${several(one.runs, "run")}`,
      () => {
        touched.current = true;
        setEntry(entriesOf({ ...found, map: one.map }));
      },
      { class: "main" },
    );
  return frame(
    p({ class: "small" }, found.understood),
    offers.length > 0 &&
      note("info", "A known map can read this file. ", span({ class: "row" }, offers.map(offer))),
    div({ class: "sheet" }, columnTable(columns, entry.columns, set, take)),
    h(QuickLoop, { columns, entries: entry.columns }),
    fold("First rows", firstRows(found)),
    h3("Values that the file does not contain"),
    restFields(found, entry.rest, setRest),
    others.length > 0 &&
      fold(
        "Save the same map for other files",
        div(
          { class: "picks" },
          others.map((one) => check(one, same.includes(one), () => setSame(toggled(same, one)))),
        ),
      ),
    div(
      { class: "actions" },
      button("Save this map", () => attempt(() => send(true, [name, ...same])), {
        class: "main",
        id: "save-map",
      }),
      found.map && button("Remove the map", () => attempt(drop), { class: "danger" }),
    ),
    h3({ class: "gap" }, "With these channels"),
    div(
      { "aria-live": "polite", id: "preview" },
      fault && note("fault", fault),
      told.previews.map((one) => previewOf(one, told.previews.length > 1, answered)),
    ),
  );
}

/** Return the table of the columns with role, unit, gain and sign. */
function columnTable(columns, entries, set, take) {
  const roles = [["", "not used"], ...app.state.choices.roles.map(({ role }) => role)];
  const unitOf = (column) => {
    const { role, unit } = entries[column.index];
    const units = role ? roleOf(role).units.map((one) => [one, one]) : [];
    for (const [name] of gainUnits(role)) units.push([name, `V, gain in ${name}`]);
    if (role && !units.some(([value]) => value === unit)) units.unshift(["", "which unit?"]);
    const props = { "aria-label": `${labelOf(column)} in`, disabled: !role };
    return select(units, unit, (next) => set(column.index, { unit: next }), props);
  };
  const roleField = (column) =>
    select(roles, entries[column.index].role, (role) => take(column, role), {
      "aria-label": `${labelOf(column)} is`,
    });
  const gainField = (column) => {
    const one = entries[column.index];
    const needed = scaleOf(one) ? neededFor(one.unit) : "";
    const props = {
      disabled: !scaleOf(one),
      "aria-label": `${labelOf(column)} gain`,
      placeholder: "–",
      needed,
    };
    return numberInput(scaleOf(one) ? one.gain : "", (gain) => set(column.index, { gain }), props);
  };
  const turned = (column) => {
    const { role, sign } = entries[column.index];
    const props = { "aria-label": `${labelOf(column)} turned`, disabled: !role };
    return check(
      "",
      sign === -1,
      (isTurned) => set(column.index, { sign: isTurned ? -1 : 1 }),
      props,
    );
  };
  const range = ({ least, most, unit }) =>
    small(`${number(least, 4)} to ${number(most, 4)} ${unit ?? ""}`);
  return table(
    [
      { title: "column", class: "name", cell: labelOf },
      { title: "holds", cell: (column) => [thumb(column.thumbnail), range(column)] },
      { title: "is", cell: roleField },
      { title: "in", cell: unitOf },
      { title: "gain", cell: gainField },
      { title: "turned", cell: turned },
    ],
    columns,
    { label: "Columns that hold numbers" },
  );
}

/** Plot of the columns that are displacement and force. */
function QuickLoop({ columns, entries }) {
  const [x, y] = ["displacement", "force"].map((role) =>
    columns.find(({ index }) => entries[index].role === role),
  );
  const key = JSON.stringify(
    [x, y].map((column) => column && [column.index, entries[column.index]]),
  );
  const data = useMemo(() => {
    try {
      const [xs, ys] = [x, y].map((column) => {
        const one = entries[column.index];
        const factor = one.sign * (scaleOf(one) ? gainOf(column, one) : 1);
        return Float64Array.from(column.sample ?? [], (value) => factor * (value ?? NaN));
      });
      return {
        series: [{ name: "loop", kind: "loop", x: xs, y: ys, colour: (colours) => colours.accent }],
      };
    } catch {
      return null; // A column or gain is missing.
    }
  }, [key]);
  if (!data) return null;
  const words = ({ index }) => {
    const one = entries[index];
    return `${one.role}, ${scaleOf(one) ? roleOf(one.role).unit : one.unit || "as in the file"}`;
  };
  return plot({
    title: "Loop of these columns",
    x: words(x),
    y: words(y),
    name: "columns",
    height: 240,
    isLoop: true,
    bare: true,
    data,
  });
}

/** Return the fields of constants, segments and session. */
function restFields({ columns }, rest, set) {
  const texts = columns.filter(({ kind }) => kind === "text").map(labelOf);
  const line = (key, placeholder) =>
    input({
      type: "text",
      id: `rest-${key}`,
      value: rest[key],
      placeholder,
      oninput: (event) => set({ [key]: event.target.value }),
    });
  return div(
    { class: "fields" },
    CONSTANTS.map(([key, words, unit, placeholder]) =>
      numberField(words, rest[key], (value) => set({ [key]: value }), {
        unit,
        placeholder,
        id: `rest-${key}`,
      }),
    ),
    field("Session", line("session", "this file"), { title: "Runs of a session share one tare." }),
    texts.length > 0 && [
      field("A new test begins at", line("split", "one test"), {
        title: `A word in ${texts.join(", ")}`,
      }),
      numberField("Currents of the tests", rest.levels, (levels) => set({ levels }), {
        many: true,
        unit: "A",
        placeholder: "0; 0.25; 0.5",
        id: "rest-levels",
      }),
    ],
  );
}

/** Return a question of the reader with its possible answers. */
function questionOf({ role, topic, candidates }, answered) {
  const units = topic === "unit" ? (roleOf(role)?.units ?? []) : [];
  const offered = [...(candidates.length ? candidates : units), ...(topic === "unit" ? ["V"] : [])];
  const words = {
    column: `Which column is the ${role}?`,
    unit: `In which unit is the ${role}?`,
    rate: "How many samples a second?",
    value: `What was the ${role}?`,
    scale: `How much ${role} is one volt?`,
    part: "Which part of the time?",
  }[topic];
  const one = (value) =>
    button(value, () => answered({ role, topic }, value), { "aria-label": `${words} ${value}` });
  const choices = span({ class: "row" }, offered.slice(0, ANSWERS_MAX).map(one));
  return note("warning", b(words), " ", offered.length ? choices : "Fill it in above.");
}

/** Return the runs of a file with a map, or its errors and questions. */
function previewOf(found, isNamed, answered) {
  const { runs = [], questions = [], findings = [], error } = found;
  const unusable = runs.filter((run) => run.error).length;
  const command = (run) =>
    run.command === null ? "varying command" : `${fixed(run.command, 2)} ${run.command_unit}`;
  const force = ({ force_range_N: range }) =>
    range ? `${fixed(range[0], 0)} to ${fixed(range[1], 0)} N` : "no force";
  const line = (run) =>
    `${run.name}: ${run.motion || "no motion recognised"}, ${command(run)}, ${number(run.stroke_mm)} mm stroke, ` +
    `${force(run)}${run.error ? `: ${run.error}` : ""}`;
  const bad = unusable ? `, ${unusable} not usable` : "";
  return div(
    isNamed && h3(found.name),
    questions.map((one) => questionOf(one, answered)),
    error && (questions.length ? fold("In full", note("fault", error)) : note("fault", error)),
    found.head_share !== undefined &&
      note(
        "info",
        `Only the first ${number(100 * found.head_share, 2)} % of ${bytes(found.bytes)} have been read.`,
      ),
    runs.length > 0 &&
      !error && [
        note(
          unusable ? "warning" : "good",
          `${several(runs.length, "run")}${bad}: ${runs.map(({ name }) => name).join(", ")}`,
        ),
        notes(runs.map(line)),
      ],
    findings.length > 0 && fold(several(findings.length, "finding"), findingList(findings)),
  );
}

function firstRows({ columns, rows }) {
  const count = Math.max(...columns.map(({ first }) => first?.length ?? 0));
  const value = (one) => (typeof one === "number" ? number(one, 6) : one);
  const column = (one) => ({
    title: labelOf(one),
    unit: one.unit,
    number: one.kind === "number",
    cell: (k) => value(one.first?.[k]),
  });
  return table(columns.map(column), [...Array(count).keys()], {
    label: `The first ${count} of ${rows ?? "all"} rows`,
  });
}

/** Return a small picture of a column. */
function thumb(values) {
  const known = (values ?? []).filter(Number.isFinite);
  if (known.length < 2) return null;
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const point = (value, k) => {
    const y = 27 - (24 * ((value ?? low) - low)) / (high - low || 1);
    return `${k ? "L" : "M"}${((100 * k) / (values.length - 1)).toFixed(1)} ${y.toFixed(1)}`;
  };
  const box = {
    class: "thumb",
    viewBox: "0 0 100 30",
    preserveAspectRatio: "none",
    "aria-hidden": "true",
  };
  return svg(box, path({ d: values.map(point).join(""), "vector-effect": "non-scaling-stroke" }));
}
