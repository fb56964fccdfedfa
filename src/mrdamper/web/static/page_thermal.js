// Thermal: heating in a load cycle, the geometry, and the search of a heat sink, for one card, geometry and load cycle.

import { getGeometry, heatCurve, putGeometry } from "./api.js";
import { formOf, inputsOf, numberField, readNumber, readSine, slider } from "./forms.js";
import {
  beyondCard,
  filesOf,
  firstScreen,
  groundsOf,
  jobOf,
  jobStatus,
  keepInput,
  resultOf,
  startButton,
  tabbed,
  tableOf,
} from "./jobs.js";
import { nth, plot } from "./plot.js";
import { sectionOf } from "./section.js";
import { app, attempt, cardInUse, choose, chosen, go, once, toast } from "./state.js";
import {
  button,
  check,
  duration,
  empty,
  field,
  fixed,
  fold,
  note,
  notes,
  number,
  several,
  tags,
  tile,
} from "./ui.js";
import { h, useEffect, useMemo, useRef, useState } from "./vendor/preact.js";

const { aside, div, form: formOfNodes, h1, h3, input, p } = tags;
const FIRST_FIELDS = {
  body: ["outer_diameter_mm", "length_mm", "wall_mm"],
  piston: ["diameter_mm", "length_mm"],
  rod: ["diameter_mm"],
  coil: ["resistance_ohm"],
  fluid: ["preset"],
};
const CALIBRATED = ["body", "piston", "rod", "coil", "fluid", "seals"]; // The calibration holds for these tables.
const TITLES = { sink: "Heat sink", manufacture: "Manufacture", heat_capacity: "Heat capacity" };

/** Return the answer to the newest request, `{value, fault}`; one request runs at a time. */
function useLatest(key, ask) {
  const [found, set] = useState({});
  const now = useRef({});
  useEffect(() => {
    const { current: one } = now;
    one.next = ask;
    const work = async () => {
      while (one.next) {
        const next = one.next;
        one.next = null;
        await next().then(
          (value) => set({ value }),
          (fault) => set((before) => ({ ...before, fault: fault.message })),
        );
      }
      one.isBusy = false;
    };
    if (!one.isBusy) work();
    one.isBusy = true;
  }, [key]);
  return found;
}

/** Return the name of the geometry in use. */
function drawingInUse() {
  const names = [...app.state.choices.dampers, ...inputsOf(".toml", ["drawing"])];
  return names.includes(chosen("drawing")) ? chosen("drawing") : names[0];
}

/** Return the geometry with its tables, null until it has arrived. */
function geometry(name) {
  const file = app.state.inputs.find((one) => one.name === name);
  return once(`geometry ${name} ${file?.modified}`, () => getGeometry(name));
}

// -------------------------------------------------------------------------------------------------- heating

/** Quick heating curve and the full study. */
function Heating({ card, form, facts, isTable }) {
  const share = chosen("heat.share", 100);
  const names = app.forms["heat curve"].map(({ name }) => name);
  let request = null;
  let fault = "";
  try {
    const given = Object.entries(form.read()).filter(([name]) => names.includes(name));
    const duty_share = readNumber("Duty", share) / 100;
    request = { ...Object.fromEntries(given), ...readSine(), card: card.name, duty_share };
  } catch (error) {
    fault = error.message;
  }
  const { value: found, fault: refused } = useLatest(
    JSON.stringify(request),
    async () => request && heatCurve(request),
  );
  const data = useMemo(() => found && curvesOf(found), [found]);
  const job = jobOf("heat", card.name);
  const study = resultOf(job);
  const percent = slider("Duty", share, (value) => choose({ "heat.share": value }), {
    unit: "%",
    min: 5,
    max: 100,
    step: 5,
    id: "heat-share",
  });
  const quick = found &&
    data &&
    !isTable && [
      tilesOf(found, card),
      div(
        { class: "pair", "data-asked": "yes" },
        plot({
          title: "Temperatures",
          x: "time, min",
          y: "temperature, °C",
          name: "temperatures",
          height: 290,
          data: data.heat,
        }),
        plot({
          title: "Peak force of a cycle",
          x: "time, min",
          y: "force, N",
          name: "peak-force",
          height: 290,
          fromZero: true,
          data: data.force,
        }),
      ),
      notes(found.notes),
    ];
  return div(
    (fault || refused) && note("fault", fault || refused),
    p({ class: "small", id: "calibration" }, facts ? calibrationOf(facts) : ""),
    isTable
      ? note("info", "The quick curve is for a sine. Start the full study for the table.")
      : percent,
    quick,
    div(
      { class: "actions" },
      button("Search a heat sink", () => choose({ "heat.tab": "Heat sink" }), { class: "main" }),
      button("Control it", () => go("controller", { card: card.name })),
      startButton("heat", "Full study with heat paths and finite elements", form.read, {
        id: "full-study",
        class: "",
      }),
    ),
    jobStatus("heat", job),
    study && studyView(study),
  );
}

function tilesOf(found, card) {
  const last = (values) => values[values.length - 1];
  const { curve, beyond, power_W: power } = found;
  const minutes = last(curve.time_s) / 60;
  const caveats = [found.assumed && `assumed: ${found.assumed}`, beyond].filter(Boolean).join("; ");
  const loss = found.force_loss_percent === null ? "–" : `${fixed(found.force_loss_percent, 0)} %`;
  return div(
    { class: "tiles", "aria-live": "polite", id: "heat-tiles" },
    tile(
      "time to the limit",
      found.time_to_limit_s === null
        ? `not in ${fixed(minutes, 0)} min`
        : duration(found.time_to_limit_s),
      beyond,
    ),
    tile(`fluid after ${fixed(minutes, 0)} min`, `${fixed(last(curve.fluid_degC), 0)} °C`, beyond),
    tile("coil", `${fixed(last(curve.coil_degC), 0)} °C`, beyond),
    card.tempered
      ? tile("force lost by heating", loss, caveats)
      : tile("force lost by heating", "unknown", "the card has no temperature model"),
    tile("heat at the start", `${number(power.mechanical + power.coil)} W`, beyond),
  );
}

function curvesOf({ curve, limit_degC: limit }) {
  const x = curve.time_s.map((second) => second / 60);
  const one = (name, values, colour, width, dash) => ({
    name,
    x,
    y: curve[values],
    colour: nth(colour),
    width,
    dash,
  });
  const isNear = Math.max(...curve.coil_degC) > limit - 40;
  return {
    heat: {
      series: [
        one("fluid, hottest point", "hottest_degC", 1, 1.2, [6, 4]),
        one("fluid", "fluid_degC", 1, 2.2),
        one("coil", "coil_degC", 2, 1.5),
        one("wall", "wall_degC", 0, 1.5),
      ],
      rules: [{ y: limit, name: `limit of the fluid, ${fixed(limit, 0)} °C`, inside: isNear }],
    },
    force: {
      series: [
        {
          ...one("peak force", "peak_force_N", 3, 2),
          y: curve.peak_force_N.map((value) => value ?? NaN),
        },
      ],
    },
  };
}

/** Return the result of the full study. */
function studyView(job) {
  const { answer } = job;
  const closure = Math.abs(answer.energy_closure);
  const words =
    closure < 1e-4
      ? "The energies close"
      : `${number(100 * closure, 2)} % of the energy does not close`;
  const own = `${job.id}-calibrated.toml`;
  const take = () =>
    attempt(() => keepInput(job, "calibrated.toml", own)).then(() => choose({ drawing: own }));
  const isCalibrated = job.files.some(({ path }) => path === "calibrated.toml");
  return [
    h3({ class: "gap" }, `Full study: ${answer.duty}`),
    p({ class: "small" }, `${words}. Heat sink: ${answer.sink ?? "none"}.`),
    filesOf(job),
    isCalibrated && button("Take the calibrated geometry", take, { id: "take-calibrated" }),
    notes(answer.notes),
  ];
}

/** Return the factors of a geometry that were fitted to a measured damper, in words; empty if it has none. */
function calibrationOf({ name, tables }) {
  const { heat_capacity: capacity = 1, film = 1 } = tables?.calibration ?? {};
  const fins = tables?.sink?.film_multiplier ?? 1;
  const all = [
    ["heat capacity", capacity],
    ["convection of the body", film],
    ["convection of the fins", fins],
  ];
  const factors = all
    .filter(([, factor]) => factor !== 1)
    .map(([words, factor]) => `${words} × ${number(factor, 4)}`);
  return factors.length
    ? `${name} contains calibration factors: ${factors.join(", ")}. They hold for the damper on which they were measured.`
    : "";
}

// ------------------------------------------------------------------------------------------------- geometry

/** Form of the geometry with its section. */
function Geometry({ base, facts }) {
  const isChanged = (kind) =>
    Object.keys(app.choice).some((key) => key.startsWith(`drawing-${kind}.`));
  const { calibration, sink, ...others } = facts.tables;
  const isOther = CALIBRATED.some(isChanged);
  const isDropped = isOther && (calibration || (sink?.film_multiplier ?? 1) !== 1);
  const tables = isOther
    ? { ...others, sink: { ...sink, film_multiplier: undefined } }
    : facts.tables;
  const kinds = Object.keys(app.forms)
    .filter((name) => name.startsWith("drawing-"))
    .map((name) => name.slice("drawing-".length));
  const forms = kinds.map((kind) => [
    kind,
    formOf(`drawing-${kind}`, { preset: tables[kind] ?? {} }),
  ]);
  const read = () => {
    const filled = (form) =>
      Object.fromEntries(Object.entries(form.read()).filter(([, value]) => value !== null));
    const isUsed = ([kind, values]) =>
      kind === "sink" ? values.fins > 0 : Object.keys(values).length;
    return Object.fromEntries(forms.map(([kind, form]) => [kind, filled(form)]).filter(isUsed));
  };
  let request = null;
  let fault = "";
  try {
    request = { tables: read() };
  } catch (error) {
    fault = error.message;
  }
  const { value: drawn, fault: refused } = useLatest(
    JSON.stringify([base, request]),
    async () => request && putGeometry(base, request),
  );
  const isPreset = app.state.choices.dampers.includes(base);
  const name = chosen("heat.name", isPreset ? "damper" : base.replace(/\.toml$/, ""));
  const isTaken = app.state.inputs.some((one) => one.name === `${name}.toml`);
  const replace = chosen("heat.replace", isTaken);
  const save = () =>
    attempt(async () => {
      const kept = await putGeometry(base, { name: name.trim(), replace, tables: read() });
      toast("good", `${kept.name} is saved with the inputs. All pages use it now.`);
      choose({
        drawing: kept.name,
        "heat.name": null,
        "heat.replace": null,
        "heat.tab": "Heating",
      });
    });
  const title = (kind) => TITLES[kind] ?? `${kind[0].toUpperCase()}${kind.slice(1)}`;
  const first = forms.filter(([kind]) => kind in FIRST_FIELDS);
  const wrong = fault || (refused && refused);
  const typed = (event) => choose({ "heat.name": event.target.value });
  return div(
    { class: "split wide-form" },
    formOfNodes(
      {
        id: "geometry-form",
        "aria-label": "Geometry of the damper",
        onsubmit: (event) => event.preventDefault(),
      },
      p(
        { class: "small" },
        `Begin with ${base}; the choice at the left changes it. An empty field has the displayed or the default value.`,
      ),
      first.map(([kind, form]) => [
        h3({ class: "gap" }, title(kind)),
        div({ class: "fields" }, form.pick(FIRST_FIELDS[kind])),
      ]),
      tags.details(
        {
          id: "all-fields",
          open: chosen("heat.all", false),
          ontoggle: (event) => choose({ "heat.all": event.target.open || null }),
        },
        tags.summary("All fields"),
        forms.map(([kind, form]) => [
          h3({ class: "gap" }, title(kind)),
          div({ class: "fields", id: `table-${kind}` }, form.rest(FIRST_FIELDS[kind] ?? [])),
        ]),
      ),
      div(
        { class: "fields gap" },
        field(
          "Name of the geometry",
          input({ type: "text", maxlength: 60, id: "drawing-name", value: name, oninput: typed }),
          { wide: true },
        ),
      ),
      isTaken &&
        check(
          "replace the geometry of the same name",
          replace,
          (on) => choose({ "heat.replace": on }),
          { id: "drawing-replace" },
        ),
      div(
        { class: "actions" },
        button("Save and use it", save, {
          class: "main",
          id: "save-drawing",
          disabled: Boolean(wrong),
        }),
      ),
    ),
    div(
      { class: "stays" },
      drawn && sectionOf(drawn),
      isDropped &&
        note(
          "info",
          `The calibration factors of ${base} were removed, because they hold for its geometry only.`,
        ),
      wrong && note("fault", wrong),
    ),
  );
}

// ------------------------------------------------------------------------------------------------ heat sink

const finsOf = (one) => ({
  fins: one.fins,
  width_mm: 1e3 * one.width_m,
  thickness_mm: 1e3 * one.thickness_m,
  pitch_mm: 1e3 * one.pitch_m,
  material: one.material,
  emissivity: one.emissivity,
});
const isSame = (one, other) => JSON.stringify(one) === JSON.stringify(other);

/** Search of a heat sink: limits, front, and the chosen design. */
function HeatSink({ card, shared, facts }) {
  const reason =
    "enter the largest mass of the fins, because the geometry has no fins whose mass is the limit.";
  const needed = facts && !facts.sink ? { mass_g: reason } : {};
  const form = formOf("heatsink", { given: { card: card.name, damper: null, duty: null }, needed });
  const read = () => {
    const { damper, duty } = shared.read();
    return { ...form.read(), damper, duty };
  };
  const job = jobOf("heatsink", card.name);
  const result = resultOf(job);
  const nothing = empty(
    "No search yet",
    "Enter the limits of the fins and press Search. The result is the front of designs that are lighter or cooler than all others.",
  );
  return div(
    { class: "split wide-form" },
    formOfNodes(
      { "aria-label": "What to search", onsubmit: (event) => event.preventDefault() },
      form.nodes(),
      form.more(),
      div({ class: "actions" }, startButton("heatsink", "Search", read)),
    ),
    div(
      jobStatus("heatsink", job),
      result ? h(Front, { job: result, key: result.id }) : !job && nothing,
    ),
  );
}

function Front({ job }) {
  const { front, reference, bare, listed = [], shown } = job.answer;
  const kept = chosen("design");
  const all = [...front, ...listed, reference, bare];
  const design =
    all.find((one) => kept?.job === job.id && isSame(one, kept.design)) ?? front[front.length - 1];
  const pick = (one) => choose({ design: { job: job.id, design: one } });
  const facts = geometry(job.options.damper);
  const data = useMemo(() => {
    const series = (name, designs, look) => ({
      name,
      designs,
      kind: "points",
      x: designs.map((one) => 1e3 * one.mass_kg),
      y: designs.map((one) => one.temperature_degC),
      radius: (k) => (isSame(designs[k], design) ? 7 : 4.5),
      ...look,
    });
    return {
      series: [
        series("front", front, { line: true, colour: (colours) => colours.accent }),
        series("present geometry", [reference], { hollow: true, colour: nth(1) }),
        series("without fins", [bare], { hollow: true, colour: (colours) => colours.soft }),
      ],
    };
  }, [design]);
  const choice = {
    pick: (k) => pick(listed[k]),
    isPicked: (k) => isSame(listed[k], design),
    words: ([name, fins]) => name || `${fins} fin${fins === "1" ? "" : "s"}`,
  };
  const use = () =>
    attempt(async () => {
      const stem = job.options.damper.replace(/\.toml$/, "").replace(/-(\d+-fins|bare)$/, "");
      const { sink: _, ...tables } = facts.tables;
      const name = `${stem}-${design.fins ? `${design.fins}-fins` : "bare"}`;
      const fins = design.fins ? { fins: finsOf(design) } : { tables };
      const saved = await putGeometry(job.options.damper, { name, replace: true, ...fins });
      toast("good", `${saved.name} is saved with the inputs. All pages use it now.`);
      choose({ drawing: saved.name, "heat.tab": "Heating" });
    });
  const isThere = facts && !facts.fault;
  const [first, ...rest] = shown?.tables ?? [];
  return div(
    firstScreen(job),
    div(
      { class: "tiles" },
      tile("chosen", design.fins ? several(design.fins, "fin") : "no fins"),
      design.fins > 0 &&
        tile(
          "width × thickness",
          `${number(1e3 * design.width_m)} × ${number(1e3 * design.thickness_m)} mm`,
        ),
      design.fins > 1 && tile("pitch", `${number(1e3 * design.pitch_m)} mm`),
      tile("mass", `${fixed(1e3 * design.mass_kg, 0)} g`),
      tile("fluid", `${fixed(design.temperature_degC, 1)} °C`, beyondCard(job.answer)),
    ),
    div(
      { class: "actions" },
      isThere && button("Use this sink", use, { class: "main", id: "use-sink" }),
    ),
    plot({
      title: "Front: click a design",
      x: "mass of the fins, g",
      y: "fluid at the end, °C",
      name: "front",
      height: 260,
      isLoop: true,
      data,
      onPick: (one, k) => pick(one.designs[k]),
    }),
    isThere
      ? sectionOf(facts, design)
      : note("warning", "The geometry of this search is not in the folder."),
    first && tableOf(first, { choice }),
    filesOf(job),
    fold(
      "More",
      groundsOf(job),
      rest.map((one) => [h3(one.title), tableOf(one)]),
      notes(shown?.notes),
    ),
  );
}

// ----------------------------------------------------------------------------------------------------- page

export function ThermalPage() {
  const title = [
    h1("Thermal"),
    p({ class: "sub" }, "The temperature of the damper in a load cycle, and a heat sink for it."),
  ];
  const card = cardInUse();
  const base = drawingInUse();
  const facts = geometry(base);
  const without = ["Geometry", () => facts?.tables && h(Geometry, { key: base, base, facts })];
  if (!card) {
    const fit = button("Go to Model", () => go("model"), { class: "main" });
    return [
      title,
      empty(
        "No card yet",
        "Heat comes from the force that a card predicts. Fit a model first, or bring a card there.",
        fit,
      ),
      without[1](),
    ];
  }
  const preset = facts?.tables ? { ambient_degC: facts.ambient_degC, air_m_s: facts.air_m_s } : {};
  const isBare = facts?.tables && facts.sink === null;
  const form = formOf("heat", { given: isBare ? { with_sink: false } : {}, preset });
  return [
    title,
    div(
      { class: "split" },
      aside(
        { class: "panel", "aria-label": "Card, geometry and load cycle" },
        form.nodes(),
        form.more("More of the study: a heat sink, calibration"),
      ),
      tabbed(
        "heat.tab",
        [
          [
            "Heating",
            () => h(Heating, { card, form, facts, isTable: Boolean(chosen("duty")?.table) }),
          ],
          without,
          ["Heat sink", () => h(HeatSink, { card, shared: form, facts })],
        ],
        "Parts of the thermal model",
      ),
    ),
  ];
}
