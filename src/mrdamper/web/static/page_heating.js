// Heating: temperatures while sliders move, the time to the fluid's limit, and the full study as a job.

import { getDamper, heatCurve, jobFile, putInput } from "./api.js";
import { button, check, duration, el, field, fill, fixed, note, number, select } from "./dom.js";
import { cardPage, damperChoice, fileLinks, heading, inputChoice, inputPicker, JobPanel, notes, numberField, slider, tile } from "./parts.js";
import { nth, Plot } from "./plot.js";

export async function show(place, app, query) {
  const title = heading("Heating", "How hot the damper gets, how soon, and how much force that costs. Move a slider and read the curve.");
  const { card, about, cards, without } = cardPage(place, app, query, "heating", title, "Heat comes from the force that a card predicts. Identify a model first, or bring a card there.");
  if (without) return without;
  const unit = about.command_unit ?? "A";
  const highest = about.envelope?.command?.[1] ?? 2;
  let limit = null;

  const damper = damperChoice(app, { id: "drawing" });
  const bring = inputPicker(app, "Bring a drawing (TOML)", ".toml", (name) => {
    damper.append(el("option", { value: name, text: name, selected: true }));
    facts();
  });

  const ambient = slider("Ambient", "°C", 20, { min: -30, max: 60, step: 1 }, ask);
  const air = slider("Air speed", "m/s", 0, { min: 0, max: 20, step: 0.5, decimals: 1 }, ask);
  const share = slider("Duty", "%", 100, { min: 5, max: 100, step: 5 }, ask);
  const command = slider(unit === "V" ? "Voltage" : "Current", unit, Math.min(2, highest), { min: 0, max: Math.max(highest, 0.1), step: 0.05, decimals: 2 }, ask);
  const amplitude = slider("Amplitude", "mm", 15, { min: 1, max: 50, step: 1 }, ask);
  const frequency = slider("Frequency", "Hz", 1, { min: 0.1, max: 5, step: 0.1, decimals: 1 }, ask);
  const time = slider("Duration", "min", 30, { min: 5, max: 240, step: 5 }, ask);
  const sink = check("with the drawing's heat sink", true);
  const past = check("go on past the fluid's limit", false);
  const duty = inputChoice(app, "Duty of the study", ".csv", ["duty"], "the sine above", { id: "study-duty", what: "table", hint: "a table of time, motion and command" });
  const other = inputChoice(app, "Heat sink of the study", ".toml", ["sink", "drawing"], "the drawing's", { id: "study-sink", what: "sink" });
  const measured = inputChoice(app, "Measured curve, to calibrate by", ".csv", ["curve"], "none", { id: "calibrate", what: "curve", hint: "time_s and fluid_degC, body_degC or coil_degC, under this duty" });
  const model = select([["zones", "three axial zones"], ["lumped", "the paper's one node"], ["reduced", "reduced finite elements"]], "zones", { id: "heat-model" });
  const first = numberField("Temperature at the start", "°C", null, { placeholder: "ambient", min: -100, max: 400 });
  const elements = check("heat paths by finite elements", true);
  for (const { box } of [sink, past]) box.addEventListener("change", ask);

  const tiles = el("div", { class: "tiles", "aria-live": "polite", id: "heat-tiles" });
  const wrong = el("div");
  const told = el("div");
  const curve = new Plot({ title: "Temperatures", x: "time, min", y: "temperature, °C", name: "temperatures", height: 340 });
  const force = new Plot({ title: "Peak force of a cycle", x: "time, min", y: "force, N", name: "peak-force", height: 200, fromZero: true });

  // ------------------------------------------------------------ one request at a time, the latest values win
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
      const found = await heatCurve({
        card,
        damper: damper.value,
        amplitude_mm: amplitude.read(),
        frequency_Hz: frequency.read(),
        command: command.read(),
        duty_share: share.read() / 100,
        duration_s: 60 * time.read(),
        ambient_degC: ambient.read(),
        air_m_s: air.read(),
        with_sink: sink.box.checked,
        past_limit: past.box.checked,
      });
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
      tile("time to the limit", found.time_to_limit_s === null ? `not in ${time.read()} min` : duration(found.time_to_limit_s)),
      tile(`fluid after ${fixed(last(minutes), 0)} min`, `${fixed(last(found.curve.fluid_degC), 0)} °C`),
      tile("coil", `${fixed(last(found.curve.coil_degC), 0)} °C`),
      tile("force lost by warmth", found.force_loss_percent === null ? "–" : `${fixed(found.force_loss_percent, 0)} %`),
      tile("heat at the start", `${number(found.power_W.mechanical + found.power_W.coil)} W`),
    );
    curve.set(
      {
        series: [
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

  /** Take ambient, air and sink from the drawing. */
  async function facts() {
    try {
      const found = await getDamper(damper.value);
      if (closed) return;
      ambient.set(found.ambient_degC);
      air.set(found.air_m_s);
      sink.box.disabled = found.sink === null;
      sink.box.checked = found.sink !== null;
      ask();
    } catch (fault) {
      fill(wrong, note("fault", fault.message));
    }
  }
  damper.addEventListener("change", facts);

  // -------------------------------------------------------------------------------------- the full study
  const study = el("div");
  const panel = new JobPanel(app, "heat", {
    done: (job) => {
      const { answer } = job;
      fill(
        study,
        el("h2", { text: `Full study: ${answer.duty}` }),
        el("p", { class: "small", text: `${Math.abs(answer.energy_closure) < 1e-4 ? "The energies close" : `Of the energy, ${number(100 * Math.abs(answer.energy_closure), 2)} % does not close`}. Sink: ${answer.sink ?? "none"}.` }),
        el("div", { class: "actions" }, el("a", { class: "button", href: jobFile(job.id, "heat.html"), target: "_blank", rel: "noopener", text: "Open the report" }), fileLinks(job, { only: (path) => !path.endsWith(".html") })),
        (job.files ?? []).some((file) => file.path === "calibrated.toml") && button("Take the calibrated drawing", () => app.attempt(() => take(job)), { id: "take-calibrated" }),
        notes(answer.notes),
        el("iframe", { class: "report", src: jobFile(job.id, "heat.html"), title: "Report of the heating study", sandbox: "", loading: "lazy" }),
      );
    },
    begun: () => fill(study),
    busy: (on) => (full.disabled = on),
  });
  /** Put the drawing that follows the measured curve among the inputs, and use it. */
  async function take(job) {
    const own = `${job.id}-calibrated.toml`;
    await putInput(new File([await (await fetch(jobFile(job.id, "calibrated.toml"))).blob()], own));
    damper.append(el("option", { value: own, text: own, selected: true }));
    app.toast("good", `${own} lies with the inputs and is the drawing now.`);
    await facts();
  }

  const full = button("Full study with heat paths and finite elements", () => {
    panel.start({
      card,
      damper: damper.value,
      duty: duty.read() ?? `sine:${amplitude.read()}mm:${frequency.read()}Hz:${command.read()}${unit}:${60 * time.read()}s`,
      sink: other.read(),
      with_sink: sink.box.checked || other.read() !== null,
      ambient_degC: ambient.read(),
      air_m_s: air.read(),
      past_limit: past.box.checked,
      model: model.value,
      start_degC: first.read(),
      calibrate: measured.read(),
      by_field: elements.box.checked,
    });
  }, { id: "full-study" });

  fill(
    place,
    title,
    el(
      "div",
      { class: "split" },
      el("aside", { class: "panel", "aria-label": "What heats and cools" },
        cards.node,
        el("div", { class: "gap" }, field("Damper's drawing", damper)),
        bring,
        el("div", { class: "gap sliders" }, [ambient, air, share, command, amplitude, frequency, time].map(({ node }) => node)),
        el("div", { class: "gap" }, sink.node, past.node)),
      el("div", {}, tiles, wrong, curve.node, force.node, told,
        el("div", { class: "actions" }, full, el("span", { class: "small", text: "at 100 % duty; about half a minute" })),
        el("details", { id: "study-more" }, el("summary", { text: "More of the study: a table of duty, a sink, calibration" }),
          el("div", { class: "fields" }, duty.node, other.node, measured.node, field("Model", model), first.node, elements.node)),
        panel.node, study),
    ),
  );
  await facts();
  panel.resume(card, query.get("job")).catch(() => {});
  return {
    close() {
      closed = true;
      for (const each of [curve, force, panel]) each.close();
    },
  };
}
