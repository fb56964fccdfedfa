// Sweeps: many jobs of one kind by a plan, which is a TOML file among the inputs; what was finished is kept.

import { inputFile, putInput } from "./api.js";
import { button, el, empty, field, fill, note, select } from "./dom.js";
import { jobForm } from "./forms.js";
import { cardInUse, filesOf, heading, JobPanel } from "./parts.js";
import { firstScreen, restOf } from "./shown.js";

export async function show(place, app, query) {
  const form = jobForm(app, "sweep");
  const plan = form.control("plan");
  const panel = new JobPanel(app, "sweep", { form, press: "Start the sweep", ready, done: drawResult });
  const { result } = panel;

  // ------------------------------------------------------------------------------------- writing a plan
  const card = cardInUse(app) ?? "NAME";
  const template = select([["tolerance", "tolerance: tracking, over dampers drawn around one"], ["fit", "fit: many campaigns, a card's figures each"], ["heatsink", "heatsink: heat sinks for many dampers and duties"]], "tolerance", { id: "template" });
  const name = el("input", { type: "text", value: "tolerance.toml", maxlength: 80, id: "plan-name" });
  const text = el("textarea", { rows: 14, spellcheck: "false", id: "plan-text" });
  const said = el("div", { "aria-live": "polite" });
  const propose = () => {
    text.value = TEMPLATES[template.value](card);
    name.value = `${template.value}.toml`;
  };
  template.addEventListener("change", propose);
  propose();
  plan.input.addEventListener("input", () =>
    app.attempt(async () => {
      if (!plan.read()) return;
      text.value = await (await fetch(inputFile(plan.read()))).text();
      name.value = plan.read();
    }));

  const keep = button("Keep this plan", async () => {
    const asked = name.value.trim();
    const own = asked.endsWith(".toml") ? asked : `${asked || "plan"}.toml`;
    if (app.state.inputs.some((input) => input.name === own) && plan.read() !== own && !window.confirm(`Write over ${own}?`)) return;
    await app.attempt(async () => {
      await putInput(new File([text.value], own));
      await app.refresh();
      plan.set(own);
      fill(said, note("good", `${own} lies with the inputs and is chosen.`));
    });
  }, { id: "keep-plan" });

  function ready() {
    if (!plan.read()) fill(panel.node, note("warning", "Choose a plan, bring one, or write one below and keep it."));
    return Boolean(plan.read());
  }

  // ------------------------------------------------------------------------------------------- what came
  function drawResult(job) {
    fill(result, firstScreen(job), restOf(job), !job.answer.cancelled && filesOf(job, "sweep.html"));
  }

  const written = el(
    "details",
    { class: "panel", open: !app.state.inputs.some((input) => input.kind === "sweep") },
    el("summary", { text: "Write a plan" }),
    el("p", { class: "small", text: "Paths count from the folder's inputs: ../cards/NAME/card.json, ../runs. What leads out of the folder is refused." }),
    el("div", { class: "row end" }, field("Begin with", template), field("Name of the plan", name)),
    el("div", { class: "gap" }, field("Plan (TOML)", text)),
    el("div", { class: "actions" }, keep),
    said,
  );
  const nothing = empty("No sweep yet", "A sweep runs many jobs of one kind on all cores. Write or bring a plan, choose it and start. Each result is kept as it comes: Resume goes on after any end.");
  const title = heading("Sweeps", "Many campaigns, a tolerance of tracking, or heat sinks for many dampers: one plan, one table.");
  panel.fillPage(place, { title, label: "What to sweep", above: [written], empty: nothing });
  await panel.resume(null, query.get("job"));
  return {
    changed: (what) => what.includes("inputs") && plan.draw(),
    close: () => panel.close(),
  };
}

const TEMPLATES = {
  tolerance: (card) => `# Dampers drawn around one: how far does tracking suffer?
kind = "tolerance"
seed = 1

[tolerance]
card = "../cards/${card}/card.json"
plant = "nominal"
draws = 8
spread_percent = 5
targets = ["sine-900N-1Hz"]
temperatures_degC = [20, 100]
`,
  fit: () => `# Many campaigns, each a folder or a file with all its runs; patterns may be used
kind = "fit"
seed = 0

[fit]
campaigns = ["../runs"]
# options of fit stand here, too, by their names
`,
  heatsink: (card) => `# Heat sinks for many dampers and duties; drawings of your own are named as files
kind = "heatsink"
seed = 0

[heatsink]
card = "../cards/${card}/card.json"
dampers = ["paper"]
duties = ["sine:15mm:1Hz:2A:1800s", "sine:10mm:2Hz:1A:1800s"]
`,
};
