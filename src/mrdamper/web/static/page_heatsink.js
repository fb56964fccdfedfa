// Heat sink: Pareto front of fluid temperature and mass. A click on a design shows it to scale.

import { drawDamperOf, getDamper } from "./api.js";
import { button, el, empty, fill, fixed, note, number } from "./dom.js";
import { drawDamper } from "./drawing.js";
import { jobForm } from "./forms.js";
import { beyondCard, cardPage, filesOf, heading, JobPanel, tile } from "./parts.js";
import { nth, Plot } from "./plot.js";
import { firstScreen, groundsOf, notesOf, tableOf } from "./shown.js";

export async function show(place, app, query) {
  const title = heading("Heat sink", "Annular fins on the body: the coolest damper for the smallest mass within the limits.");
  const { card, cards, without } = cardPage(place, app, query, "heatsink", title, "A sink is searched for the heat that a card's force makes. Fit a model first.");
  if (without) return without;
  const form = jobForm(app, "heatsink", { given: { card }, changed: (name) => name === "damper" && app.attempt(limit) });
  const front = new Plot({ title: "Front: click a design", x: "mass of the fins, g", y: "fluid at the end of the duty, °C", name: "front", height: 340, onPick: (one, k) => one.designs && choose(one.designs[k]) });
  const drawn = el("figure", { class: "plot", id: "section" });
  const list = el("div");
  const next = el("span");
  const chosenTiles = el("div", { class: "tiles" });
  let job = null;
  let facts = null;
  let chosen = null;

  const panel = new JobPanel(app, "heatsink", { form, press: "Search", done: drawResult });

  /** Require a mass limit if the geometry has no fins whose mass is the limit. */
  async function limit() {
    const { sink } = await getDamper(form.control("damper").read());
    form.control("mass_g").require(sink ? "" : "enter the largest mass of the fins, because the geometry has no fins whose mass is the limit.");
  }

  async function drawResult(found) {
    job = found;
    const { answer } = job;
    facts = await getDamper(job.options.damper).catch(() => null);
    chosen = null;
    fill(
      panel.result,
      firstScreen(job),
      el("div", { class: "pair" }, front.node, drawn),
      chosenTiles,
      el("div", { class: "actions" }, next),
      list,
      filesOf(job, "heatsink.html"),
      groundsOf(job),
      notesOf(job),
      answer.shown?.tables.slice(1).map((one) => tableOf(one)),
    );
    const designs = answer.front;
    const point = (one) => [1000 * one.mass_kg, one.temperature_degC];
    const words = (set) => (k) => `${set[k].fins} fins`;
    front.set({
      series: [
        { name: "front", x: designs.map((one) => point(one)[0]), y: designs.map((one) => point(one)[1]), designs, kind: "points", line: true, colour: (c) => c.accent, radius: (k) => (same(designs[k], chosen) ? 7 : 4.5), words: words(designs) },
        { name: "as drawn", x: [point(answer.reference)[0]], y: [point(answer.reference)[1]], designs: [answer.reference], kind: "points", colour: nth(1), radius: 5, hollow: true, words: words([answer.reference]) },
        { name: "without fins", x: [point(answer.bare)[0]], y: [point(answer.bare)[1]], designs: [answer.bare], kind: "points", colour: (c) => c.soft, radius: 5, hollow: true, words: words([answer.bare]) },
      ],
    });
    const kept = JSON.parse(app.chosen("design") ?? "{}");
    const all = [...designs, ...(answer.listed ?? []), answer.reference, answer.bare];
    choose((kept.job === job.id && all.find((one) => same(one, kept.design))) || designs[designs.length - 1]);
  }

  function choose(design) {
    chosen = design;
    app.choose("design", JSON.stringify({ job: job.id, design }));
    front.draw();
    drawList();
    fill(
      chosenTiles,
      tile("chosen", design.fins ? `${design.fins} fin${design.fins === 1 ? "" : "s"}` : "no fins"),
      design.fins > 0 && tile("width × thickness", `${number(1e3 * design.width_m)} × ${number(1e3 * design.thickness_m)} mm`),
      design.fins > 1 && tile("pitch", `${number(1e3 * design.pitch_m)} mm`),
      tile("mass", `${fixed(1000 * design.mass_kg, 0)} g`),
      tile("fluid", `${fixed(design.temperature_degC, 1)} °C`, beyondCard(job.answer)),
    );
    fill(next, facts && button("Use this sink", () => app.attempt(() => use(design)), { class: "main", id: "use-sink" }));
    if (facts) drawDamper(drawn, facts, design);
    else fill(drawn, note("warning", "The drawing of this search is no longer in the folder."));
  }

  /** Save the geometry with the fins of this design, and use it. */
  async function use(design) {
    const stem = `${job.options.damper.replace(/\.toml$/, "").replace(/-(\d+-fins|bare)$/, "")}-${design.fins ? `${design.fins}-fins` : "bare"}`;
    const { sink: _, ...tables } = facts.tables;
    const kept = await drawDamperOf(job.options.damper, { name: stem, replace: true, ...(design.fins ? { fins: finsOf(design) } : { tables }) });
    await app.refresh();
    app.choose("drawing", kept.name);
    app.toast("good", `${kept.name} is saved with the inputs. All pages use it now.`);
    app.go("heating", { card });
  }

  function drawList() {
    const { listed, shown } = job.answer;
    if (listed) fill(list, tableOf(shown.tables[0], null, {
      pick: (k) => choose(listed[k]),
      picked: (k) => same(listed[k], chosen),
      words: ([name, fins]) => name || `${fins} fin${fins === "1" ? "" : "s"}`,
    }));
  }

  const nothing = empty("No search yet", "Enter the limits of the fins and press Search. The result is the front of designs that are lighter or cooler than all others.");
  panel.fillPage(place, { title, label: "What to search", first: [cards.node], empty: nothing });
  await panel.resume(card, query.get("job"));
  await app.attempt(limit);
  return {
    close() {
      for (const each of [front, panel]) each.close();
    },
  };
}

const finsOf = (one) => ({ fins: one.fins, width_mm: 1e3 * one.width_m, thickness_mm: 1e3 * one.thickness_m, pitch_mm: 1e3 * one.pitch_m, material: one.material, emissivity: one.emissivity });
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
