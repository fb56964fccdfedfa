// Section of a damper with its fins along the axis, to scale in millimetres.

import { tags } from "./ui.js";

const { figcaption, figure, line, path, rect, svg, text, title } = tags;

const NO_SINK = { fins: 0, width_m: 0, thickness_m: 0, pitch_m: 0 };
const sinkOf = ({ sink }) =>
  sink
    ? {
        fins: sink.fins,
        width_m: sink.width_mm / 1e3,
        thickness_m: sink.thickness_mm / 1e3,
        pitch_m: sink.pitch_mm / 1e3,
      }
    : NO_SINK;

/** Return the section of a geometry (in millimetres, from the server) with the fins of a design. */
export function sectionOf(facts, design = sinkOf(facts)) {
  const [radius, length] = [facts.outer_diameter_mm / 2, facts.length_mm];
  const [width, thickness, pitch] = [design.width_m, design.thickness_m, design.pitch_m].map(
    (value) => 1e3 * value,
  );
  const [wall, cap, rod] = [facts.wall_mm, facts.cap_mm, facts.rod_mm / 2];
  const [piston, face] = facts.piston_mm;
  const out = 0.16 * length;
  const tall = radius + Math.max(width, 6);
  const box = (name, x, y, w, h) => rect({ class: name, x, y, width: w, height: h });
  const span = Math.max(0, design.fins - 1) * pitch + thickness;
  const left = length / 2 - span / 2;
  const fins = [...Array(design.fins).keys()].flatMap((k) =>
    [-radius - width, radius].map((y) => box("fin", left + k * pitch, y, thickness, width)),
  );
  const size = Math.max(5, length / 22);
  const words = (x, y, said, anchor = "middle") =>
    text({ x, y, "font-size": size, "text-anchor": anchor }, said);
  const mm = (value) => `${Number(value.toFixed(1))} mm`;
  const measure = (from, to, y) =>
    path({ class: "dim", d: `M${from} ${y - 2}v4M${from} ${y}H${to}M${to} ${y - 2}v4` });
  const pitched = design.fins > 1 ? `, pitch ${mm(pitch)}` : "";
  return figure(
    { class: "plot", id: "section" },
    figcaption("To scale, section along the axis"),
    svg(
      {
        class: "section",
        role: "img",
        viewBox: [-out - 10, -tall - 22, length + 2 * out + 28, 2 * tall + 52].join(" "),
      },
      title(`Section of the damper with ${design.fins} fins, to scale`),
      fins,
      box("body", 0, -radius, length, 2 * radius),
      box("fluid", cap, -radius + wall, length - 2 * cap, 2 * (radius - wall)),
      box("rod", -out, -rod, facts.through ? length + 2 * out : out + length / 2, 2 * rod),
      box("rod", (length - face) / 2, -piston / 2, face, piston),
      line({ class: "axis", x1: -out - 8, x2: length + out + 8, y1: 0, y2: 0 }),
      measure(0, length, tall + 9),
      words(length / 2, tall + 11 + size, mm(length)),
      words(length + 3, -radius + size, `⌀ ${mm(2 * radius)}`, "start"),
      design.fins > 0 && [
        measure(left, left + span, -tall - 9),
        words(
          length / 2,
          -tall - 12,
          `${design.fins} × ${mm(thickness)}${pitched}, ${mm(width)} wide`,
        ),
      ],
    ),
  );
}
