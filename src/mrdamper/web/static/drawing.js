// A damper with its fins, drawn to scale: a section along the axis, in millimetres.

import { button, el, fill, save, svg } from "./dom.js";

const SAVED = {
  ".body": "fill:#87909a", ".fluid": "fill:#8fb6cf", ".rod": "fill:#5b646d", ".fin": "fill:#2f6794", ".axis": "stroke:#5b646d;stroke-width:.35",
  ".dim": "stroke:#5b646d;stroke-width:.4;fill:none", text: "fill:#22282e;font-family:sans-serif",
};

/**
 * Draw a damper with a design's fins into a figure.
 *
 * @param {HTMLElement} place
 * @param {object} facts geometry from the server, in millimetres
 * @param {{fins: number, width_m: number, thickness_m: number, pitch_m: number}} fins of the sink; missing: the sink of the geometry
 */
export function drawDamper(place, facts, design = sinkOf(facts)) {
  const [radius, length] = [facts.outer_diameter_mm / 2, facts.length_mm];
  const [width, thick, pitch] = [design.width_m, design.thickness_m, design.pitch_m].map((value) => 1e3 * value);
  const [wall, cap, rod] = [facts.wall_mm, facts.cap_mm, facts.rod_mm / 2];
  const [piston, face] = facts.piston_mm;
  const out = 0.16 * length;
  const tall = radius + Math.max(width, 6);
  const edge = 22;
  const box = [-out - 10, -tall - edge, length + 2 * out + 28, 2 * tall + 2 * edge + 8];
  const image = svg("svg", { class: "drawing", viewBox: box.map((value) => value.toFixed(2)).join(" "), role: "img" });
  image.append(svg("title", {}, `Section of the damper with ${design.fins} fins, to scale`));
  const rect = (name, x, y, w, h) => image.append(svg("rect", { class: name, x: x.toFixed(3), y: y.toFixed(3), width: w.toFixed(3), height: h.toFixed(3) }));
  const shaft = () => rect("rod", -out, -rod, facts.through ? length + 2 * out : out + length / 2, 2 * rod);
  const span = design.fins > 1 ? (design.fins - 1) * pitch + thick : thick;
  for (let k = 0; k < design.fins; k += 1) {
    const x = length / 2 - span / 2 + k * pitch;
    rect("fin", x, -radius - width, thick, width);
    rect("fin", x, radius, thick, width);
  }
  rect("body", 0, -radius, length, 2 * radius);
  rect("fluid", cap, -radius + wall, length - 2 * cap, 2 * (radius - wall));
  shaft();
  rect("rod", (length - face) / 2, -piston / 2, face, piston);
  image.append(svg("line", { class: "axis", x1: -out - 8, x2: length + out + 8, y1: 0, y2: 0 }));
  const size = Math.max(5, length / 22);
  const text = (x, y, said, anchor = "middle") => image.append(svg("text", { x, y, "font-size": size.toFixed(1), "text-anchor": anchor }, said));
  const mm = (value) => `${Number(value.toFixed(1))} mm`;
  image.append(svg("path", { class: "dim", d: `M0 ${tall + 7}v4M0 ${tall + 9}H${length}M${length} ${tall + 7}v4` }));
  text(length / 2, tall + 11 + size, mm(length));
  if (design.fins) {
    const x = length / 2 - span / 2;
    image.append(svg("path", { class: "dim", d: `M${x} ${-tall - 7}v-4M${x} ${-tall - 9}H${x + span}M${x + span} ${-tall - 7}v-4` }));
    text(length / 2, -tall - 12, `${design.fins} × ${mm(thick)}${design.fins > 1 ? `, pitch ${mm(pitch)}` : ""}, ${mm(width)} wide`);
  }
  text(length + 3, -radius + size, `⌀ ${mm(2 * radius)}`, "start");
  const saving = button("SVG", () => saveImage(image), { title: "Save this drawing as SVG" });
  const head = el("div", { class: "plot-head" }, el("figcaption", { text: "To scale, section along the axis" }), el("div", { class: "tools" }, saving));
  fill(place, head, image, el("p", { class: "small", text: "Body, wall, piston, rod and fins are as drawn." }));
}

function sinkOf({ sink }) {
  if (!sink) return { fins: 0, width_m: 0, thickness_m: 0, pitch_m: 0 };
  return { fins: sink.fins, width_m: sink.width_mm / 1e3, thickness_m: sink.thickness_mm / 1e3, pitch_m: sink.pitch_mm / 1e3 };
}

function saveImage(image) {
  const copy = image.cloneNode(true);
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  const [, , wide, high] = copy.getAttribute("viewBox").split(" ");
  copy.setAttribute("width", `${wide}mm`);
  copy.setAttribute("height", `${high}mm`);
  const sheet = Object.entries(SAVED).map(([name, rule]) => `${name}{${rule}}`).join("");
  copy.prepend(svg("style", {}, sheet));
  save("heat-sink.svg", new Blob([new XMLSerializer().serializeToString(copy)], { type: "image/svg+xml" }));
}
