// Heating: temperatures for the sliders, time to the limit of the fluid, and the full study as a job.

import { getDamper, heatCurve, jobFile } from "./api.js";
import { button, duration, el, fill, fixed, note, number } from "./dom.js";
import { dutyText, firstSine, jobForm, sineOf, slider, tableChoice } from "./forms.js";
import { cardPage, filesOf, heading, JobPanel, keepInput, notes, tile } from "./parts.js";
import { nth, Plot } from "./plot.js";

export async function show(place, app, query) {
  const title = heading("Heating", "How hot the damper gets, how soon, and how much force that costs. Move a slider and read the curve.");
  const { card, about, cards, without } = cardPage(place, app, query, "heating", title, "Heat comes from the force that a card predicts. Fit a model first, or bring a card there.");
  if (without) return without;
  const unit = about.command_unit ?? "A";
  const highest = about.envelope?.command?.[1] ?? 2;
  let limit = null;

  const first = firstSine(app, "sine:15mm:1Hz:2A:1800s");
  const share = slider("Duty", "%", 100, { min: 5, max: 100, step: 5 });
  const sine = {
    command: slider(unit === "V" ? "Voltage" : "Current", unit, first.command, { min: 0, max: Math.max(highest, 0.1), step: 0.05, decimals: 2 }),
    amplitude_mm: slider("Amplitude", "mm", first.amplitude_mm, { min: 1, max: 50, step: 1 }),
    frequency_Hz: slider("Frequency", "Hz", first.frequency_Hz, { min: 0.1, max: 5, step: 0.1, decimals: 1 }),
  };
  const time = slider("Duration", "min", 30, { min: 5, max: 240, step: 5 });
  const motion = () => ({ ...Object.fromEntries(Object.entries(sine).map(([name, one]) => [name, one.read()])), duration_s: 60 * time.read() });
  const tabled = tableChoice(app, "Duty of the study", "the sine above", "study-duty");
  const duty = {
    node: el("div", { class: "wide sliders" }, [share, ...Object.values(sine), time].map(({ node }) => node)),
    read: () => tabled.read() ?? dutyText({ ...motion(), unit }),
    set(text) {
      const found = sineOf(text);
      tabled.set(found ? null : text);
      for (const [name, one] of Object.entries(sine)) if (found && (name !== "command" || found.unit === unit)) one.set(found[name]);
      if (found) time.set(found.duration_s / 60);
    },
  };
  const form = jobForm(app, "heat", { given: { card }, slots: { duty }, changed: (name) => (name === "damper" ? facts() : ask()) });
  const drawing = form.control("damper");
  share.input.addEventListener("input", () => app.keepField("heat curve", "share", share.read())); // The job has no such option.
  app.remember("heat curve", { restore: (name, value) => (share.set(value), ask()) });
  const curveNames = app.forms["heat curve"].map((one) => one.name);

  const tiles = el("div", { class: "tiles", "aria-live": "polite", id: "heat-tiles" });
  const wrong = el("div");
  const told = el("div");
  const calibration = el("p", { class: "small", id: "calibration" });
  const curve = new Plot({ title: "Temperatures", x: "time, min", y: "temperature, °C", name: "temperatures", height: 340 });
  const force = new Plot({ title: "Peak force of a cycle", x: "time, min", y: "force, N", name: "peak-force", height: 200, fromZero: true });

  // ------------------------------------------------------------ one request at a time
  let busy = false;
  let again = false;
  let closed = false;

  async function ask() {
    if (busy) {
      again = true;
      return;
    }
    busy = true;
    const began = performance.now();
    try {
      const given = Object.entries(form.read()).filter(([name]) => curveNames.includes(name));
      const found = await heatCurve({ ...Object.fromEntries(given), ...motion(), duty_share: share.read() / 100 });
      if (closed) return;
      fill(wrong);
      draw(found);
      curve.node.dataset.ms = (performance.now() - began).toFixed(1);
      curve.node.dataset.asked = String(Number(curve.node.dataset.asked ?? 0) + 1);
    } catch (fault) {
      if (closed) return;
      fill(wrong, note("fault", fault.message));
    } finally {
      busy = false;
      if (again && !closed) {
        again = false;
        ask();
      }
    }
  }

  function draw(found) {
    const minutes = found.curve.time_s.map((second) => second / 60);
    limit = found.limit_degC;
    const last = (values) => values[values.length - 1];
    fill(
      tiles,
      tile("time to the limit", found.time_to_limit_s === null ? `not in ${time.read()} min` : duration(found.time_to_limit_s), found.beyond),
      tile(`fluid after ${fixed(last(minutes), 0)} min`, `${fixed(last(found.curve.fluid_degC), 0)} °C`, found.beyond),
      tile("coil", `${fixed(last(found.curve.coil_degC), 0)} °C`, found.beyond),
      about.tempered
        ? tile("force lost by heating", found.force_loss_percent === null ? "–" : `${fixed(found.force_loss_percent, 0)} %`, [found.assumed && `assumed: ${found.assumed}`, found.beyond].filter(Boolean).join("; "))
        : tile("force lost by heating", "unknown", "the card has no temperature model"),
      tile("heat at the start", `${number(found.power_W.mechanical + found.power_W.coil)} W`, found.beyond),
    );
    curve.set(
      {
        series: [
          { name: "fluid, hottest point", x: minutes, y: found.curve.hottest_degC, colour: nth(1), width: 1.2, dash: [6, 4] },
          { name: "fluid", x: minutes, y: found.curve.fluid_degC, colour: nth(1), width: 2.2 },
          { name: "coil", x: minutes, y: found.curve.coil_degC, colour: nth(2), width: 1.5 },
          { name: "wall", x: minutes, y: found.curve.wall_degC, colour: nth(0), width: 1.5 },
        ],
        rules: [{ y: limit, name: `limit of the fluid, ${fixed(limit, 0)} °C`, inside: Math.max(...found.curve.coil_degC) > limit - 40 }],
      },
      { keepView: true },
    );
    force.set({ series: [{ name: "peak force", x: minutes, y: found.curve.peak_force_N.map((value) => value ?? NaN), colour: nth(3), width: 2 }] }, { keepView: true });
    fill(told, notes(found.notes));
  }

  /** Show ambient temperature, air speed and sink of the geometry. */
  async function facts() {
    try {
      const found = await getDamper(drawing.read());
      if (closed) return;
      form.follow(found);
      calibration.textContent = calibrationOf(found);
      ask();
    } catch (fault) {
      fill(wrong, note("fault", fault.message));
    }
  }

  // -------------------------------------------------------------------------------------- the full study
  const study = el("div");
  const panel = new JobPanel(app, "heat", {
    form,
    done: (job) => {
      const { answer } = job;
      fill(
        study,
        el("h2", { text: `Full study: ${answer.duty}` }),
        el("p", { class: "small", text: `${Math.abs(answer.energy_closure) < 1e-4 ? "The energies close" : `Of the energy, ${number(100 * Math.abs(answer.energy_closure), 2)} % does not close`}. Sink: ${answer.sink ?? "none"}.` }),
        filesOf(job, "heat.html"),
        (job.files ?? []).some((file) => file.path === "calibrated.toml") && button("Take the calibrated drawing", () => app.attempt(() => take(job)), { id: "take-calibrated" }),
        notes(answer.notes),
        el("iframe", { class: "report", src: jobFile(job.id, "heat.html"), title: "Report of the heating study", sandbox: "", loading: "lazy" }),
      );
    },
    begun: () => fill(study),
    busy: (on) => (full.disabled = on),
  });
  /** Save the calibrated geometry with the inputs, and use it. */
  async function take(job) {
    const own = `${job.id}-calibrated.toml`;
    await keepInput(app, job, "calibrated.toml", own, "it is the drawing of the next steps.");
    drawing.set(own);
    app.choose("drawing", own);
    await facts();
  }

  const full = button("Full study with heat paths and finite elements", () => panel.start(form.read), { id: "full-study" });
  fill(
    place,
    title,
    el(
      "div",
      { class: "split" },
      el("aside", { class: "panel", "aria-label": "What heats and cools" },
        cards.node, form.nodes()),
      el("div", {}, tiles, wrong, calibration, curve.node, force.node, told,
        el("div", { class: "actions" }, button("Search a heat sink", () => app.go("heatsink", { card }), { class: "main", id: "next-sink" }), button("Track with it", () => app.go("tracking", { card })), button("Export it", () => app.go("export", { card })), full, el("span", { class: "small", text: "at 100 % duty; about half a minute" })),
        form.more("More of the study: a table of duty, a sink, calibration", { id: "study-more" }, tabled.node),
        panel.node, study),
    ),
  );
  await facts();
  if (await panel.resume(card, query.get("job")).catch(() => null)) await facts();
  return {
    close() {
      closed = true;
      for (const each of [curve, force, panel]) each.close();
    },
  };
}

/** Return the factors of a geometry that were fitted to a measured damper, in words; empty if it has none. */
function calibrationOf({ name, tables }) {
  const { heat_capacity: capacity = 1, film = 1 } = tables.calibration ?? {};
  const fins = tables.sink?.film_multiplier ?? 1;
  const factors = [["heat capacity", capacity], ["convection of the body", film], ["convection of the fins", fins]].filter(([, factor]) => factor !== 1);
  return factors.length ? `${name} contains calibration factors: ${factors.map(([quantity, factor]) => `${quantity} × ${number(factor, 4)}`).join(", ")}. They hold for the damper on which they were measured.` : "";
}
