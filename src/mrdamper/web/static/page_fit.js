// Fit: choice of the law and of held-out runs, progress of the fit, errors by run, and parameters with uncertainty.

import { cardFile, getJob, getRuns, jobFile } from "./api.js";
import { addressed, button, el, empty, fill, note, number, opening } from "./dom.js";
import { cardName, fitTable } from "./fits.js";
import { cardsOf, jobForm } from "./forms.js";
import { cardInUse, heading, JobPanel } from "./parts.js";
import { Plot } from "./plot.js";
import { runChoice } from "./run_choice.js";
import { firstScreen, groundsOf, notesOf, tablesOf } from "./shown.js";
import { motionOf } from "./run_marks.js";
import { CHOSEN, LinkedView } from "./view.js";

const FIRST_RUNS = 3; // Number of runs that the view of a fit shows first.

export async function show(place, app, query) {
  const { runs: all, reading } = await getRuns();
  const runs = all.filter((run) => !run.error);
  const result = el("div");
  const tables = el("div"); // Tables need the full width.
  const cards = el("div");
  const predicted = el("div");
  const cost = new Plot({ title: "Cost while fitting", x: "evaluation, steps", y: "error, % of spread", name: "cost", height: 220 });
  const costBox = el("div", { hidden: true }, cost.node);
  const course = { all: [], best: [] };

  // ------------------------------------------------------------------------------------ options
  const units = unitsOf(runs);
  const names = () => choice.runs().map((run) => run.name);
  const choice = runChoice(runs, (byHand) => {
    if (byHand) app.choose("runs", JSON.stringify(choice.read()));
    form.offer("runs", names());
    start.disabled = !names().length;
  });
  const form = jobForm(app, "fit", { given: { files: null, only: [] }, offered: { runs: names() } });
  form.set({ card: freeName(app) });
  const start = button("Identify", begin, { class: "main", id: "start-fit", disabled: !runs.length });

  const asked = {
    set(options) {
      form.set(options);
      choice.take(options);
    },
    share() {
      const kept = app.chosen("runs");
      if (kept) choice.take(JSON.parse(kept));
    },
  };
  const panel = new JobPanel(app, "fit", {
    form: asked,
    begun: () => {
      course.all.length = 0;
      course.best.length = 0;
      costBox.hidden = true;
      fill(result);
      fill(tables);
    },
    busy: (on) => {
      start.disabled = on || !runs.length;
    },
    progress: (told) => {
      if (!Number.isFinite(told.cost_percent)) return;
      course.all.push(told.cost_percent);
      course.best.push(told.best_percent ?? told.cost_percent);
      drawCost();
    },
    done: (job) => {
      drawCost();
      drawResult(job);
    },
  });
  let due = null;

  function drawCost() {
    due ??= requestAnimationFrame(() => {
      due = null;
      costBox.hidden = !course.all.length;
      const x = course.all.map((_, k) => k + 1);
      cost.set({
        series: [
          { name: "this step", x, y: course.all, colour: (colours) => colours.measured, width: 1.2 },
          { name: "best so far", x, y: course.best, colour: (colours) => colours.accent, width: 2 },
        ],
      });
    });
  }

  async function begin() {
    await panel.start(() => {
      const options = form.read();
      const card = cardName(options.card ?? "damper");
      app.choose("card", card);
      return { ...options, card, ...choice.read() };
    });
  }

  // ---------------------------------------------------------------------------------------- result
  function drawResult(job) {
    const { answer } = job;
    const card = job.options.card;
    fill(
      result,
      el("h2", { text: `${card}: ${answer.law}` }),
      firstScreen(job),
      groundsOf(job),
      el(
        "div",
        { class: "actions" },
        button("Look at the loops with it", () => app.go("loops", { card }), { class: "main" }),
        opening(cardFile(card, "report.html"), "Open the report", { class: "button" }),
        button("Draw the damper", () => app.go("drawing")),
        button("How hot does it get?", () => app.go("heating", { card })),
      ),
      el("h3", { class: "gap", text: "Notes" }),
      notesOf(job),
      el("p", { class: "small", text: `The fit took ${number(answer.cpu_s)} s of CPU.` }),
    );
    fill(
      tables,
      el("h2", { text: "Measured and modelled" }),
      drawView(job),
      tablesOf(job, addressOf(card)),
      answer.identifiability?.sentence && el("p", { class: "small", text: answer.identifiability.sentence }),
    );
  }

  /** Return the address of the loops of a run with a card. */
  const addressOf = (card) => (run) => `#/loops?${new URLSearchParams({ run, card })}`;

  let view = null;
  let named = query.get("job"); // Fit whose runs and cards are in the address.

  /** Return the linked view of a fit. First it shows the worst runs of one motion, held-out runs before others. */
  function drawView(job) {
    const { answer, options } = job;
    const kept = addressed();
    if (named !== job.id) {
      if (named) for (const name of CHOSEN) kept.delete(name);
      named = job.id;
      kept.set("job", job.id);
      app.keep(kept);
    }
    const worst = [...answer.runs].sort((a, b) => (b.split === "held_out") - (a.split === "held_out") || b.nrmse_percent - a.nrmse_percent);
    const found = worst.flatMap(({ name }) => runs.find((run) => run.name === name) ?? []);
    view?.close();
    const motion = found.filter((run) => motionOf(run) === motionOf(found[0]));
    view = new LinkedView(app, found, { runs: motion.slice(0, FIRST_RUNS), cards: [options.card] });
    return el("div", { class: "split" }, el("aside", { class: "panel", "aria-label": "Drawn runs and cards" }, view.aside), view.node);
  }

  // ------------------------------------------------------------------------------------------ cards kept
  const prediction = new JobPanel(app, "evaluate", {
    done: (job) => {
      fill(predicted, el("h3", { text: `${job.options.card} on ${job.answer.runs.length} runs` }), firstScreen(job), groundsOf(job), notesOf(job), tablesOf(job, addressOf(job.options.card)));
    },
  });
  const comparison = new JobPanel(app, "compare", {
    done: (job) => {
      const page = (job.files ?? []).find((file) => file.path === "compare.html");
      fill(compared, page && opening(jobFile(job.id, "compare.html"), `Open ${job.options.first} against ${job.options.second}`, { class: "button" }));
    },
  });
  const compared = el("div");

  /** Return the files on which a card can be evaluated; null: all. */
  function filesFor(card) {
    const unit = app.state.cards.find((one) => one.name === card)?.command_unit;
    return units.length > 1 && units.includes(unit) ? filesIn(runs, unit) : null;
  }

  const fits = fitTable(app, {
    async again(card, job) {
      const { options } = await getJob(job.id); // The single record contains the file names.
      asked.set({ ...options, card: freeName(app), replace: false });
      place.scrollIntoView();
      app.toast("info", `The form shows the options of ${card.name}.`);
    },
    compare: (first, second) => comparison.start({ first, second }),
  });

  function drawCards() {
    fits.draw();
    if (!app.state.cards.length) {
      fill(cards);
      return;
    }
    const trial = jobForm(app, "evaluate");
    trial.set({ card: cardInUse(app, query.get("card")) });
    const tried = () => prediction.start(() => {
      const options = trial.read();
      return { ...options, files: options.files ?? filesFor(options.card) };
    });
    fill(
      cards,
      el("h3", { class: "gap", text: "Predict: how a card does on runs" }),
      trial.panel("What to predict", button("Predict", tried, { id: "evaluate", disabled: !runs.length })),
    );
  }

  const hint = runs.length
    ? empty("No fit yet", `${runs.length} runs are ready. Keep the default law, hold out one or two runs, and press Identify. The fit takes seconds to a minute. You can leave this page during the fit.`)
    : empty("No runs to fit", reading ? "Files are still being read; come back in a moment." : "A model is identified from runs. Add files first, and map their channels if they are not understood.", button("Go to Runs", () => app.go("runs"), { class: "main" }));
  fill(result, hint);
  fill(
    place,
    heading("Fit", "One law for all currents and temperatures. The result is a card, which heating, heat sink, tracking and export use."),
    el("div", { class: "split" }, form.panel("What to fit", start, choice.node), el("div", {}, panel.node, costBox, result)),
    fits.node,
    comparison.node,
    compared,
    tables,
    cards,
    prediction.node,
    predicted,
  );
  drawCards();
  const wanted = query.get("job");
  const job = wanted ? await getJob(wanted).catch(() => null) : null;
  if (job?.kind === "evaluate") {
    await prediction.attach(job.id);
    await panel.resume();
  } else await panel.resume(null, wanted).catch((fault) => fill(result, note("fault", fault.message)));
  if (!start.disabled) form.set({ card: freeName(app), replace: false });

  return {
    address: (next) => (view && next.get("job") === panel.job?.id ? view.read(next) : app.again()),
    changed: (what) => {
      if (!runs.length && what.includes("files")) app.again();
      else if (what.includes("cards")) {
        drawCards();
        view?.drawChoice();
      }
    },
    close() {
      for (const each of [panel, prediction, comparison, cost, view]) each?.close();
    },
  };
}

/** Return the command units of the runs, the most frequent unit first. */
function unitsOf(runs) {
  const found = [...new Set(runs.map((run) => run.command_unit).filter(Boolean))];
  const count = (unit) => runs.filter((run) => run.command_unit === unit).length;
  return found.sort((a, b) => count(b) - count(a));
}

const filesIn = (runs, unit) => [...new Set(runs.filter((run) => run.command_unit === unit).map((run) => run.file))];

function freeName(app) {
  const taken = new Set(cardsOf(app).map((card) => card.name).concat(app.state.cards.map((card) => card.name)));
  for (let k = 1; ; k += 1) {
    const name = k === 1 ? "damper" : `damper-${k}`;
    if (!taken.has(name)) return name;
  }
}
