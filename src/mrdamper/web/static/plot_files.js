// Files of a plot: SVG, PNG and CSV.

import { lowerBound } from "./decimate.js";
import { el, save } from "./dom.js";
import { CanvasPen, SvgPen } from "./pens.js";
import { palette } from "./theme.js";

const CSV_ROWS = 2_500_000;
const LEGEND_PX = 22;

const sizeOf = (plot) => [plot.box.clientWidth || 800, plot.options.height + LEGEND_PX];

/** Return a plot as an SVG document, in the light colours. */
export function svgOf(plot) {
  const measure = new CanvasPen(plot.canvas.getContext("2d"));
  const pen = new SvgPen(...sizeOf(plot), (said, size) => measure.width(said, size));
  plot.render(pen, ...sizeOf(plot), palette(true), { legend: true });
  return pen.document();
}

export function saveSvg(plot) {
  save(`${plot.options.name}.svg`, new Blob([svgOf(plot)], { type: "image/svg+xml" }));
  plot.draw();
}

export function savePng(plot) {
  const [width, height] = sizeOf(plot);
  const canvas = el("canvas", { width: 2 * width, height: 2 * height });
  const context = canvas.getContext("2d");
  context.setTransform(2, 0, 0, 2, 0, 0);
  plot.render(new CanvasPen(context), width, height, palette(true), { legend: true });
  canvas.toBlob((blob) => save(`${plot.options.name}.png`, blob));
  plot.draw();
}

export function saveCsv(plot) {
  save(`${plot.options.name}.csv`, new Blob(csvOf(plot), { type: "text/csv" }));
}

/** Return the visible series inside the view as CSV parts: one table for a shared x, else rows by name. */
function csvOf(plot) {
  const shown = plot.visible();
  if (!shown.length) return [""];
  const { x: xName, y: yName } = plot.options;
  const shared = shown.every((one) => one.x === shown[0].x);
  const within = (one) => {
    if (one.kind !== "series" || !plot.view) return plot.within(one);
    return [lowerBound(one.x, plot.view.x[0]), lowerBound(one.x, plot.view.x[1])];
  };
  const pieces = [`${(shared ? [xName, ...shown.map((one) => `${one.name} (${yName})`)] : ["series", xName, yName]).map(quoted).join(",")}\n`];
  let left = CSV_ROWS;
  for (const one of shared ? shown.slice(0, 1) : shown) {
    const [from, to] = within(one);
    let lines = [];
    for (let k = from; k < to && left > 0; k += 1, left -= 1) {
      const values = shared ? [one.x[k], ...shown.map((other) => other.y[k])] : [one.x[k], one.y[k]];
      lines.push(`${shared ? "" : `${quoted(one.name)},`}${values.map(plain).join(",")}\n`);
      if (lines.length === 20000) {
        pieces.push(lines.join(""));
        lines = [];
      }
    }
    pieces.push(lines.join(""));
  }
  return pieces;
}

const plain = (value) => (Number.isFinite(value) ? String(Number(Number(value).toPrecision(9))) : "");
const guarded = (said) => (/^[=+\-@\t\r]/.test(said) ? `'${said}` : said); // A spreadsheet would evaluate the text.
const quoted = (said) => `"${guarded(String(said)).replaceAll('"', '""')}"`;
