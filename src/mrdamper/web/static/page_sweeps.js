// Sweeps: many jobs of one kind by a plan, which is a TOML file among the inputs; what was finished is kept.

import { inputFile, putInput } from "./api.js";
import { button, el, empty, field, fill, note, number, select, table } from "./dom.js";
import { jobForm } from "./forms.js";
import { cardInUse, filesOf, heading, JobPanel, nameAndUnit, notes, tile } from "./parts.js";

const MOST_COLUMNS = 8;
const MOST_ROWS = 500;

export async function show(place, app, query) {
  const form = jobForm(app, "sweep");
  const plan = form.control("plan");
  const panel = new JobPanel(app, "sweep", { form, press: "Start the sweep", ready, done: drawResult });
  const { result } = panel;

  // ------------------------------------------------------------------------------------- writing a plan
  const card = cardInUse(app) ?? "NAME";
  const template = select([["tolerance", "tolerance: tracking, over dampers drawn around one"], ["identify", "identify: many campaigns, a card's figures each"], ["sink", "sink: heat sinks for many dampers and duties"]], "tolerance", { id: "template" });
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
    const { answer } = job;
    if (answer.cancelled || !answer.rows) {
      fill(result, notes([`${answer.done} of ${answer.tasks} are done.`]));
      return;
    }
    const failed = answer.failed ?? [];
    const figures = Object.entries(answer.summary ?? {});
    const columns = [...new Set(answer.rows.flatMap((row) => Object.keys(row)))].filter((key) => key !== "name").slice(0, MOST_COLUMNS);
    fill(
      result,
      el("h2", { text: `${answer.plan}: ${answer.kind}` }),
      el("div", { class: "tiles" }, tile("tasks", String(answer.tasks)), tile("failed", String(failed.length)), tile("seed", String(answer.seed)), answer.taken_up > 0 && tile("kept from before", String(answer.taken_up))),
      figures.length > 0 && table(
        [
          { title: "figure", class: "name", cell: ([key]) => nameAndUnit(key)[0] },
          { title: "unit", class: "whole", cell: ([key]) => nameAndUnit(key)[1] || "–" },
          { title: "count", number: true, cell: ([, one]) => String(one.count) },
          ...[["least", "least"], ["5 %", "p5"], ["median", "median"], ["95 %", "p95"], ["most", "most"]].map(([title, key]) => ({ title, number: true, cell: ([, one]) => number(one[key], 4) })),
        ],
        figures,
        { caption: "Over all tasks" },
      ),
      failed.length > 0 && el("h2", { text: "What failed" }),
      failed.length > 0 && table([{ title: "task", class: "name", cell: (one) => one.name }, { title: "why", class: "name", cell: (one) => one.error }], failed, { caption: "Tasks without a result" }),
      el("h2", { text: "Each task" }),
      table(
        [{ title: "task", class: "whole", cell: (row) => row.name }, ...columns.map((key) => ({ title: nameAndUnit(key)[0], unit: nameAndUnit(key)[1], number: typeof answer.rows[0]?.[key] === "number", cell: (row) => (typeof row[key] === "number" ? number(row[key], 4) : row[key]) }))],
        answer.rows.slice(0, MOST_ROWS),
        { caption: answer.rows.length > MOST_ROWS ? `The first ${MOST_ROWS} of ${answer.rows.length}; all are in the files` : "Results by task", tall: true },
      ),
      filesOf(job, "sweep.html"),
      notes(answer.notes),
    );
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
  identify: () => `# Many campaigns, each a folder or a file with all its runs; patterns may be used
kind = "identify"
seed = 0

[identify]
campaigns = ["../runs"]
# options of identify stand here, too, by their names
`,
  sink: (card) => `# Heat sinks for many dampers and duties; drawings of your own are named as files
kind = "sink"
seed = 0

[sink]
card = "../cards/${card}/card.json"
dampers = ["paper"]
duties = ["sine:15mm:1Hz:2A:1800s", "sine:10mm:2Hz:1A:1800s"]
`,
};
