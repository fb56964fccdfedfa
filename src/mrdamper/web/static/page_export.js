// Export: C code, FMU, force map, card and report. The code is compared with the model before it is written.

import { cardFile } from "./api.js";
import { el, empty, fill, opening } from "./dom.js";
import { jobForm } from "./forms.js";
import { cardPage, fileLinks, heading, JobPanel, missingControllers } from "./parts.js";
import { firstScreen, groundsOf, notesOf, tablesOf } from "./shown.js";

export async function show(place, app, query) {
  const title = heading("Export", "Code for the target. It is compiled and compared with the model before you can download it.");
  const { card, about, cards, without } = cardPage(place, app, query, "export", title, "C code, FMUs and force maps are made from a card. Identify one first.");
  if (without) return without;
  const form = jobForm(app, "export", { given: { card }, only: { controller: about.controllers } });
  if (!about.controllers.length) form.set({ content: "model" });
  const panel = new JobPanel(app, "export", { form, press: "Make and verify", done: drawResult });

  function drawResult(job) {
    const { answer } = job;
    const shown = (path) => !path.includes("/") || path.endsWith(".md");
    fill(
      panel.result,
      firstScreen(job),
      groundsOf(job),
      el("h3", { text: "Downloads" }),
      fileLinks(job, { only: (path) => shown(path) && path !== "job.json" }),
      answer.fmu_platforms && el("p", { class: "small", id: "platforms", text: platformWords(answer.fmu_platforms) }),
      answer.fingerprint && el("p", { class: "small" }, "Fingerprint ", el("code", { text: answer.fingerprint })),
      notesOf(job),
      tablesOf(job),
    );
  }

  const kept = el(
    "section",
    { class: "panel" },
    el("h3", { text: `The card ${card} itself` }),
    el("p", { class: "small", text: `${about.title || about.law}, ${about.runs} run${about.runs === 1 ? "" : "s"}. The card is data: it never holds code.` }),
    el("div", { class: "row" },
      el("a", { class: "button", href: cardFile(card, "card.json"), download: `${card}.json`, text: "card.json" }),
      about.report && opening(cardFile(card, "report.html"), "Report", { class: "button" }),
      about.report && el("a", { class: "button", href: cardFile(card, "errors.csv"), download: `${card}-errors.csv`, text: "errors.csv" })),
  );
  const nothing = empty("Nothing made yet", "Tick what you need and press Make and verify. The C code is compiled here and compared with the model, sample by sample.");
  panel.fillPage(place, { title, label: "What to export", first: [cards.node, missingControllers(app, about)], above: [kept], empty: nothing });
  await panel.resume(card, query.get("job"));
  return {
    close() {
      panel.close();
    },
  };
}

const PLATFORMS = { linux64: "Linux (64 bit)", win64: "Windows (64 bit)", darwin64: "macOS (64 bit)" };

/** Return the platforms on which an FMU runs as it is. */
function platformWords(folders) {
  const binaries = folders.length ? `The FMU runs on ${folders.map((name) => PLATFORMS[name] ?? name).join(", ")}.` : "The FMU has no binary.";
  return `${binaries} For other platforms it contains the C sources.`;
}
