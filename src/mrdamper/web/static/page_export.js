// Export: C, FMU, force map, card and report of a card, proved against the model before they are written.

import { cardFile } from "./api.js";
import { citePanel } from "./cite.js";
import { button, check, el, empty, field, fill, note, number, select } from "./dom.js";
import { cardPage, fileLinks, heading, inputsOf, inWords, JobPanel, notes, numberField, tile } from "./parts.js";

const CONTROLLERS = ["recommended", "recommended-causal", "paper"];

export async function show(place, app, query) {
  const title = heading("Export", "Take the card to its target. The code is compiled and compared with the model before you can download it.");
  const { card, about, cards, without } = cardPage(place, app, query, "export", title, "C code, FMUs and force maps are made from a card. Identify one first.");
  if (without) return without;
  const what = [["c", "C99 source, as an archive"], ["fmu", "FMU for co-simulation"], ["table", "force map (CSV) for simulators"]].map(([key, text]) => ({ key, ...check(text, key !== "table", { id: `what-${key}` }) }));
  const fmi = select([["3.0", "FMI 3.0"], ["2.0", "FMI 2.0"]], "3.0");
  const content = select([["both", "model and controller"], ["model", "the model"], ["controller", "the controller"]], about.actuation ? "both" : "model");
  const precision = select([["float", "float (32 bit)"], ["double", "double (64 bit)"]], "float");
  const controller = select([...new Set([...CONTROLLERS, ...app.state.choices.controllers])], "recommended");
  const period = numberField("Period", "ms", 1, { min: 0.05 });
  const name = el("input", { type: "text", value: "damper", maxlength: 40, pattern: "[A-Za-z][A-Za-z0-9_]*" });
  const damper = select([["", "the paper's"], ...inputsOf(app, ".toml")], "");
  const start = button("Make and verify", begin, { class: "main", id: "start-export" });
  const result = el("div");
  const panel = new JobPanel(app, "export", { done: drawResult, busy: (on) => (start.disabled = on), begun: () => fill(result) });

  function begin() {
    const asked = what.filter(({ box }) => box.checked).map(({ key }) => key);
    if (!asked.length) {
      fill(panel.node, note("warning", "Choose at least one thing to make."));
      return;
    }
    panel.start({
      card,
      what: asked,
      fmi: fmi.value,
      precision: precision.value,
      period_s: (period.read() ?? 1) / 1000,
      content: content.value,
      controller: controller.value,
      name: name.value.trim() || "damper",
      damper: damper.value || null,
    });
  }

  function drawResult(job) {
    const { answer } = job;
    const proof = answer.verification;
    const shown = (path) => !path.includes("/") || path.endsWith(".md");
    fill(
      result,
      proof && note(proof.passed ? "good" : "warning", proof.passed ? `Verified: the compiled code is the model (${proof.compiler_version ?? "C compiler"}).` : `Not verified. ${(proof.problems ?? []).join("; ")}`),
      el(
        "div",
        { class: "tiles" },
        answer.content && tile("holds", answer.content === "both" ? "model and controller" : inWords(answer.content)),
        answer.precision && tile("numbers", answer.precision),
        answer.step_s && tile("period", `${number(1000 * answer.step_s)} ms`),
        answer.tables_bytes && tile("tables", `${number(answer.tables_bytes / 1024)} KiB`),
        answer.state_bytes && tile("state", `${answer.state_bytes} B`),
      ),
      el("h3", { text: "Downloads" }),
      fileLinks(job, { only: (path) => shown(path) && path !== "job.json" }),
      answer.fingerprint && el("p", { class: "small" }, "Fingerprint ", el("code", { text: answer.fingerprint })),
      notes(answer.notes),
    );
  }

  const form = el(
    "form",
    { class: "panel", "aria-label": "What to export", onsubmit: (event) => event.preventDefault() },
    cards.node,
    el("h3", { class: "gap", text: "Make" }), what.map(({ node }) => node),
    el("div", { class: "fields gap" }, field("FMU", fmi), field("Numbers", precision), field("Holds", content, { wide: true, hint: about.actuation ? "" : "no run of this card steps its current: the recommended controllers need to know that lag" }), field("Controller", controller, { wide: true }), period.node, field("Prefix of names", name)),
    el("div", { class: "gap" }, field("Drawing, for a frozen thermometer", damper)),
    el("div", { class: "actions" }, start),
  );
  const kept = el(
    "section",
    { class: "panel" },
    el("h3", { text: `The card ${card} itself` }),
    el("p", { class: "small", text: `${about.title || about.law}, ${about.runs} run${about.runs === 1 ? "" : "s"}. The card is data: it never holds code.` }),
    el("div", { class: "row" },
      el("a", { class: "button", href: cardFile(card, "card.json"), download: `${card}.json`, text: "card.json" }),
      about.report && el("a", { class: "button", href: about.report, target: "_blank", rel: "noopener", text: "Report" }),
      about.report && el("a", { class: "button", href: cardFile(card, "errors.csv"), download: `${card}-errors.csv`, text: "errors.csv" })),
  );
  fill(result, empty("Nothing made yet", "Tick what you need and press Make and verify. The C code is compiled here and compared with the model, sample by sample."));
  fill(place, title, el("div", { class: "split" }, form, el("div", {}, kept, citePanel(card), el("div", { class: "gap" }, panel.node, result))));
  await panel.resume(card, query.get("job"));
  return {
    close() {
      panel.close();
    },
  };
}
