// Section of a damper with its fins along the axis, to scale in millimetres.

import { tags } from "./ui.js";

const { figcaption, figure, line, path, rect, svg, text, title } = tags;
const NO_FINS = { fins: 0, width_mm: 0, thickness_mm: 0, pitch_mm: 0 };

export function sectionOf(facts, sink = facts.sink ?? NO_FINS) {
	const [radius, length] = [facts.outer_diameter_mm / 2, facts.length_mm];
	const { fins, width_mm: width, thickness_mm: thickness, pitch_mm: pitch } = sink;
	const { wall_mm: wall, cap_mm: cap, rod_mm: rod } = facts;
	const [piston, face] = facts.piston_mm;
	const out = 0.16 * length; // length of the drawn part of the rod outside the body
	const tall = radius + Math.max(width, 6);
	const box = (colour, x, y, w, h) => rect({ fill: `var(--${colour})`, x, y, width: w, height: h });
	const thin = { stroke: "var(--soft)", "stroke-width": 0.4, fill: "none" };
	const span = Math.max(0, fins - 1) * pitch + thickness;
	const left = length / 2 - span / 2;
	const fin = (_, k) =>
		[-radius - width, radius].map((y) => box("accent", left + k * pitch, y, thickness, width));
	const size = Math.max(5, length / 22);
	const words = (x, y, content, anchor = "middle") =>
		text({ x, y, fill: "var(--soft)", "font-size": size, "text-anchor": anchor }, content);
	const mm = (value) => `${Number(value.toFixed(1))} mm`;
	const measure = (from, to, y) =>
		path({ ...thin, d: `M${from} ${y - 2}v4M${from} ${y}H${to}M${to} ${y - 2}v4` });
	const pitched = fins > 1 ? `, pitch ${mm(pitch)}` : "";
	const margin = 16 + size;
	const wide = length + 2 * out + 28 + size;
	const viewBox = [-out - 10, -tall - margin, wide, 2 * (tall + margin)].join(" ");
	return figure.plot(
		{ id: "section" },
		figcaption("To scale, section along the axis"),
		svg(
			{ role: "img", viewBox },
			title(`Section of the damper with ${fins} fins, to scale`),
			Array.from({ length: fins }, fin),
			box("faint", 0, -radius, length, 2 * radius),
			box("fluid", cap, -radius + wall, length - 2 * cap, 2 * (radius - wall)),
			box("soft", -out, -rod / 2, facts.through ? length + 2 * out : out + length / 2, rod),
			box("soft", (length - face) / 2, -piston / 2, face, piston),
			line({ ...thin, x1: -out - 8, x2: length + out + 8, y1: 0, y2: 0 }),
			measure(0, length, tall + 9),
			words(length / 2, tall + 11 + size, mm(length)),
			words(length + 3, -radius + size, `⌀ ${mm(2 * radius)}`, "start"),
			fins > 0 && [
				measure(left, left + span, -tall - 9),
				words(length / 2, -tall - 14, `${fins} × ${mm(thickness)}${pitched}, ${mm(width)} wide`),
			],
		),
	);
}
