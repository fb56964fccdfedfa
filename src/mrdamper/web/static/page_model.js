// Model: choice of the law and of held-out runs, the result of a fit, and the table of fits.

import { cardFile, deleteCard, getJob, putCard } from "./api.js";
import { fillForm, formOf, literal } from "./forms.js";
import { jobColumns, removal } from "./jobs.js";
import { keptFold, pageHead, table, tag, titled } from "./layout.js";
import { firstScreen, groundsOf, tabsOf } from "./results.js";
import { commonest, copiesOf, filtersOf, foreignRunsOf, idOf, matching, runList } from "./runs.js";
import { address, app, attempt, choose, chosen, go, toast } from "./state.js";
import { fixed, number, several, toggled } from "./text.js";
import { button, check, filePicker, opening, search, tags } from "./ui.js";
import { linkedView } from "./view.js";

const { a, b, div, h2, p, span } = tags;
const RUNS_MAX = 3; // Runs that the loops of a fit show.
const FITS_MAX = 8; // Longer tables of fits scroll.
const NAME = /[/\\:*?"<>|\p{C}]+/gu;

/** Return a card name that is valid as the name of a folder. */
const cardName = (text) => text.replace(NAME, "-");

function freeName() {
  const isTaken = (name) => app.state.cards.some((card) => card.name === name);
  let name = "damper";
  for (let k = 2; isTaken(name); k += 1) name = `damper-${k}`;
  return name;
}

/** Return the runs to be fitted: they match the filters, have the same command unit, and are not excluded. */
function fittedRuns(runs, without) {
  const usual = commonest(runs.map((run) => run.command_unit).filter(Boolean));
  const isUsual = (run) => chosen("choose.unit") || !usual || run.command_unit === usual;
  const isChosen = (run) => isUsual(run) && !without.includes(idOf(run, runs));
  return matching(runs, "choose").filter(isChosen);
}

function runChoice(runs, fitted, without) {
  const [copies, foreign] = [copiesOf(runs), foreignRunsOf(runs)];
  const found = matching(runs, "choose");
  const countOf = (marked, one, many) => {
    const count = found.filter((run) => marked.has(run)).length;
    return count ? `; ${count} ${count === 1 ? `is ${one}` : `are ${many}`}` : "";
  };
  const marks = (run) =>
    [
      copies.has(run) && `a copy of ${copies.get(run).name}`,
      foreign.get(run),
      run.worst === "fault" && "with a fault",
    ].filter(Boolean);
  const ids = fitted.map((run) => idOf(run, runs));
  const change = (next) => {
    const [one] = [...ids, ...next].filter((id) => ids.includes(id) !== next.includes(id));
    choose({ "choose.without": toggled(without, one) });
  };
  const another = "probably of another damper";
  const counts = countOf(copies, "a copy", "copies") + countOf(foreign, another, another);
  const words = `${ids.length} of ${several(runs.length, "run")}${counts}`;
  const list = () => runList("Fitted runs", found, runs, ids, change, marks);
  return div(filtersOf(runs, "choose"), keptFold("choose.open", "chosen-runs", words, list));
}

/** Return the chosen runs as job options (files and run names). If all runs are chosen, both options are empty. */
function runOptions(runs, fitted) {
  if (fitted.length === runs.length) return { files: null, only: [] };
  const files = [...new Set(fitted.map((run) => run.file))];
  const isWhole = runs.every((run) => fitted.includes(run) || !files.includes(run.file));
  return { files, only: isWhole ? [] : fitted.map((run) => literal(run.name)) };
}

/** Show the options of an earlier fit in the form. */
async function again(card, job, runs) {
  const { options } = await getJob(job.id); // Only the record of a single job contains the file names.
  const isWanted = ({ file, name }) =>
    (!options.files || options.files.includes(file)) &&
    (!options.only?.length || options.only.includes(literal(name)));
  const without = runs.filter((run) => !isWanted(run)).map((run) => idOf(run, runs));
  const keys = Object.keys(app.choice).filter((key) => key.startsWith("choose."));
  const cleared = Object.fromEntries(keys.map((key) => [key, null]));
  const given = { ...options, card: null, replace: false };
  fillForm("fit", given, { ...cleared, "choose.without": without });
  window.scrollTo(0, 0);
  toast("info", `The form shows the options of ${card.name}.`);
}

function resultView(job, runs) {
  const { answer, options } = job;
  const { card } = options;
  const isHeld = ({ split }) => split === "held_out";
  const isWorse = (x, y) => isHeld(y) - isHeld(x) || y.nrmse_percent - x.nrmse_percent;
  const worst = [...answer.runs].sort(isWorse);
  const found = worst.map(({ name }) => runs.find((run) => run.name === name)).filter(Boolean);
  const picked = found.filter((run) => run.motion === found[0].motion).slice(0, RUNS_MAX);
  const link = (...names) => address("data", { "view.runs": names, "view.cards": [card] });
  const loops = () => linkedView({ runs, picked, cards: [card], prefix: "loops", panes: "dvfr" });
  const sentence = answer.identifiability?.sentence;
  return [
    h2(`${card}: ${answer.law}`),
    firstScreen(job),
    groundsOf(job),
    div.actions(
      button("How hot does it get?", () => go("thermal", { card }), "main"),
      button("Control it", () => go("controller", { card })),
      opening(cardFile(card, "report.html"), "Open the report", { class: "button" }),
      a.button({ href: link(...picked.map((run) => idOf(run, runs))) }, "All plots"),
      span.small(`${number(answer.cpu_s)} s of CPU`),
    ),
    tabsOf("loops.tab", job, [["Loops", loops]], link),
    sentence && p.small(sentence),
  ];
}

const range = (pair, unit) =>
  pair ? `${number(pair[0])} to ${number(pair[1])} ${unit ?? ""}` : "";
const dateOf = ({ modified }) => String(modified).slice(0, 16).replace("T", " ");

function stateOf({ cancelled, converged }) {
  if (cancelled) return "cancelled";
  return converged === false ? "not converged" : converged && "yes";
}

/** Columns of the table of fits by their key: title, value, class, and unit; numbers have two decimals. */
const COLUMNS = {
  name: ["fit", ({ name }) => name, "name"],
  law: ["law", ({ law }) => law, "whole"],
  runs: ["runs", ({ runs }) => runs, "n"],
  cost: ["cost", ({ cost_percent: cost }) => cost, "n", "%"],
  converged: ["converged", stateOf, "whole"],
  held: ["held out", ({ held_out_percent: held }) => held, "n", "%, median"],
  command: ["command", (card) => range(card.envelope?.command, card.command_unit), "whole"],
  temperature: ["temperature", (card) => range(card.envelope?.temperature_degC, "°C"), "whole"],
  modified: ["date", dateOf, "whole"],
};

/** Return the fits that match the filter, in order; unknown values are last. */
function sortedFits(sort) {
  const [, value] = COLUMNS[sort.replace("-", "")] ?? COLUMNS.name;
  const find = chosen("fits.find", "").toLowerCase();
  const isFound = ({ name, law }) => `${name} ${law ?? ""}`.toLowerCase().includes(find);
  const isKnown = (card) => (value(card) ?? "") !== "";
  const compare = (one, other) => {
    const [x, y] = [value(one), value(other)];
    return typeof x === "number" ? x - y : x.localeCompare(y, "en", { numeric: true });
  };
  const found = app.state.cards.filter(isFound);
  const known = found.filter(isKnown).sort(compare);
  if (sort.startsWith("-")) known.reverse();
  return [...known, ...found.filter((card) => !isKnown(card))];
}

function fitTable(runs) {
  const all = app.state.cards;
  const isCard = (name) => all.some((card) => card.name === name);
  const ticked = chosen("fits.ticked", []).filter(isCard);
  const sort = chosen("fits.sort", "-modified");
  const bring = ([file]) =>
    attempt(() => putCard(file, cardName(file.name.replace(/\.json$/i, ""))));
  const bringCard = filePicker("Bring a card", ".json", bring, "");
  const frame = (...body) => div({ id: "fits" }, titled("Fits", body));
  if (!all.length)
    return frame(p.small("No card yet: identify one, or bring a card.json."), bringCard);
  const jobOfCard = ({ name }) =>
    app.state.jobs.find((job) => job.kind === "fit" && job.options.card === name);
  const link = (card) => {
    const job = jobOfCard(card);
    const result = () => address("model", { "fit.job": job.id, card: card.name });
    const href = job ? result() : address("data", { "view.cards": [card.name] });
    const name = a({ href, title: job ? "Its result" : "Its loops" }, b(card.name));
    return [name, card.error && span.small(` ${card.error}`)];
  };
  const tick = ({ name, error }) => {
    const change = () => choose({ "fits.ticked": toggled(ticked, name) });
    const props = { "aria-label": `Overlay ${name}`, disabled: Boolean(error) };
    return check("", ticked.includes(name), change, props);
  };
  const actions = (card) => {
    const [{ name }, job] = [card, jobOfCard(card)];
    const repeat = () => attempt(() => again(card, job, runs));
    const report = { "aria-label": `Report of ${name}` };
    return span.row(
      card.report && opening(cardFile(name, "report.html"), "report", report),
      job && button("Again", repeat, "quiet", `Again with the options of ${name}`),
      removal(deleteCard, name),
    );
  };
  const columnOf = ([key, [title, value, look, unit]]) => {
    const [isUp, isDown] = [sort === key, sort === `-${key}`];
    const order = () => choose({ "fits.sort": isUp ? `-${key}` : key });
    const mark = isUp ? " ↑" : isDown ? " ↓" : "";
    const text = (card) => {
      const shown = value(card);
      if (["cancelled", "not converged"].includes(shown)) return tag("warning", shown);
      return unit ? fixed(shown, 2) : shown;
    };
    const cell = key === "name" ? link : text;
    return [button(`${title}${mark}`, order, "quiet", `Sort by ${title}`), cell, look, unit];
  };
  const columns = [["", tick], ...Object.entries(COLUMNS).map(columnOf), ["", actions, "whole"]];
  const overlay = () =>
    go("data", { "view.cards": ticked, "view.colour": "card", "view.tab": null });
  const [first, second] = ticked;
  const compare = () =>
    go("jobs", { "show.kind": "compare", "compare.first": first, "compare.second": second });
  const shown = sortedFits(sort);
  const remark = `${shown.length} of ${several(all.length, "fit")}`;
  return frame(
    div(
      { class: "row end" },
      search("Find", "fits.find", "name or law"),
      button("Overlay", overlay, "", { disabled: !ticked.length }),
      button("Report of the difference", compare, "", { disabled: ticked.length !== 2 }),
      bringCard,
    ),
    table("Fits", columns, shown, { note: remark, tall: shown.length > FITS_MAX }),
  );
}

export function ModelPage() {
  const runs = app.runs.filter((run) => !run.error);
  const copies = [...copiesOf(runs).keys()].map((run) => idOf(run, runs));
  const without = chosen("choose.without", copies);
  const fitted = fittedRuns(runs, without);
  const form = formOf("fit", {
    given: { files: null, only: [] },
    offered: { runs: fitted.map(({ name }) => name) },
    preset: { card: freeName() },
  });
  const read = () => {
    const options = form.read();
    return { ...options, card: cardName(options.card ?? freeName()), ...runOptions(runs, fitted) };
  };
  const ready = `${several(runs.length, "run")} can be fitted. Keep the default law, hold out one or two runs, and press Identify. The fit takes seconds to a minute. You can leave this page during the fit.`;
  const none =
    "A model is identified from runs. Add files on Data first, and map their channels if they are not understood.";
  return [
    pageHead(
      "Model",
      "One law for all currents and temperatures. The result is a card, which all later steps use.",
    ),
    jobColumns("fit", "What to fit", "Identify", form, {
      read,
      started: ({ card }) => choose({ card, "fit.card": null }),
      disabled: !fitted.length,
      first: runChoice(runs, fitted, without),
      nothing: runs.length ? ready : none,
      view: (job) => resultView(job, runs),
    }),
    fitTable(runs),
  ];
}
