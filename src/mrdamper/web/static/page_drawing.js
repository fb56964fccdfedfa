// Drawing: form of the geometry with its section. The geometry is a TOML file for all later steps.

import { drawDamperOf, getDamper } from "./api.js";
import { button, check, el, field, fill, note, select } from "./dom.js";
import { drawDamper } from "./drawing.js";
import { inputPicker, inputsOf, jobForm } from "./forms.js";
import { heading } from "./parts.js";

const WAIT_MS = 200;
const FOLDED = ["seals", "sink", "calibration", "manufacture"]; // Optional tables.
const GEOMETRY = ["body", "piston", "rod", "coil", "fluid", "seals"]; // The calibration holds for these tables.
const TITLES = { sink: "Heat sink", manufacture: "What can be made" };

export async function show(place, app, query) {
  const names = [...app.state.choices.dampers, ...inputsOf(app, ".toml", ["drawing"])];
  const base = [query.get("drawing"), app.chosen("drawing")].find((name) => names.includes(name)) ?? names[0];
  const kinds = Object.keys(app.forms).filter((name) => name.startsWith("drawing-")).map((name) => name.slice("drawing-".length));
  const tables = new Map(kinds.map((kind) => [kind, jobForm(app, `drawing-${kind}`, { changed: () => later(GEOMETRY.includes(kind)) })]));
  const drawn = el("figure", { class: "plot", id: "section" });
  const wrong = el("div", { "aria-live": "polite" });
  const name = el("input", { type: "text", maxlength: 60, id: "drawing-name" });
  const over = check("replace a drawing of the same name", false, { id: "drawing-replace" });
  const from = select(names, base, { id: "drawing-base" });
  const save = button("Save and use it", keep, { class: "main", id: "save-drawing" });
  const edge = { id: "drawing-form", class: "panel", "aria-label": "Geometry of the damper", onsubmit: (event) => event.preventDefault() };
  const dropped = el("div", { "aria-live": "polite" });
  let timer = null;
  let calibrated = null; // Tables of the base until a dimension is changed.
  let asked = new AbortController();

  /** Return the tables with entries. */
  function read() {
    const found = [...tables].map(([kind, form]) => [kind, Object.fromEntries(Object.entries(form.read()).filter(([, value]) => value !== null))]);
    return Object.fromEntries(found.filter(([kind, table]) => (kind === "sink" ? table.fins > 0 : Object.keys(table).length)));
  }

  async function draw() {
    asked.abort();
    asked = new AbortController();
    try {
      drawDamper(drawn, await drawDamperOf(base, { tables: read() }, asked.signal));
      fill(wrong);
      save.disabled = false;
    } catch (fault) {
      if (fault.name === "AbortError") return;
      fill(wrong, note("fault", fault.message));
      save.disabled = true;
    }
  }

  function later(geometry) {
    if (geometry) dropCalibration();
    clearTimeout(timer);
    timer = setTimeout(draw, WAIT_MS);
  }

  /** Clear the calibration factors of the base geometry once. Later entries of the user stay. */
  function dropCalibration() {
    const { calibration, sink } = calibrated ?? {};
    calibrated = null;
    if (!calibration && (sink?.film_multiplier ?? 1) === 1) return;
    tables.get("calibration").set(Object.fromEntries(app.forms["drawing-calibration"].map((one) => [one.name, one.begins])));
    tables.get("sink").set({ film_multiplier: null });
    fill(dropped, note("info", `The calibration factors of ${base} were removed, because they hold for its geometry only.`));
  }

  async function begin() {
    const found = await getDamper(base);
    calibrated = found.tables;
    for (const [kind, form] of tables) {
      const nothing = Object.fromEntries(app.forms[`drawing-${kind}`].map((one) => [one.name, one.begins]));
      form.set({ ...nothing, ...found.tables[kind] });
    }
    name.value = app.state.choices.dampers.includes(base) ? "damper" : base.replace(/\.toml$/, "");
    over.box.checked = names.includes(`${name.value}.toml`);
    await draw();
  }

  async function keep() {
    await app.attempt(async () => {
      const kept = await drawDamperOf(base, { name: name.value.trim(), replace: over.box.checked, tables: read() });
      await app.refresh();
      app.choose("drawing", kept.name);
      app.toast("good", `${kept.name} is saved with the inputs. All pages use it now.`);
      app.go("heating");
    });
  }

  from.addEventListener("change", () => app.go("drawing", { drawing: from.value }));
  const titled = (kind) => TITLES[kind] ?? `${kind[0].toUpperCase()}${kind.slice(1)}`;
  fill(
    place,
    heading("Drawing", "Geometry of your damper for the heating model. An empty field has the displayed or the default value."),
    el("div", { class: "split wide-form" },
      el("form", edge,
        field("Begin with", from), inputPicker(app, "Bring a drawing (TOML)", ".toml", (file) => app.go("drawing", { drawing: file })),
        [...tables].map(([kind, form]) => (FOLDED.includes(kind)
          ? el("details", { id: `table-${kind}` }, el("summary", { text: titled(kind) }), form.nodes())
          : [el("h3", { class: "gap", text: titled(kind) }), form.nodes()])),
        el("div", { class: "fields gap" }, field("Name of the drawing", name, { wide: true })), over.node,
        el("div", { class: "actions" }, save)),
      el("div", { class: "stays" }, drawn, dropped, wrong)),
  );
  await app.attempt(begin);
  return {
    close() {
      clearTimeout(timer);
      asked.abort();
    },
  };
}
