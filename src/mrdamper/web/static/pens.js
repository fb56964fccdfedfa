// Two pens with the same interface: one draws on a canvas, one writes SVG.
//
// Paths are arrays of pixels `[x0, y0, x1, y1, ...]`; NaN lifts the pen.

const FONT = '"Segoe UI", "DejaVu Sans", Helvetica, Arial, sans-serif';

/** Pen that draws on the context of a canvas, in CSS pixels. */
export class CanvasPen {
  constructor(context) {
    this.context = context;
  }

  rect(x, y, width, height, fill) {
    this.context.fillStyle = fill;
    this.context.fillRect(x, y, width, height);
  }

  clip(x, y, width, height) {
    this.context.save();
    this.context.beginPath();
    this.context.rect(x, y, width, height);
    this.context.clip();
  }

  unclip() {
    this.context.restore();
  }

  line(points, { colour, width = 1, dash = [] }) {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.setLineDash(dash);
    context.beginPath();
    let down = false;
    let strokes = 0;
    for (let k = 0; k < points.length; k += 2) {
      const x = points[k];
      const y = points[k + 1];
      if (x !== x || y !== y) down = false;
      else if (down) context.lineTo(x, y);
      else {
        context.moveTo(x, y);
        down = true;
      }
      strokes += 1;
      if (strokes === 8000 && down) {
        // Long paths block the browser.
        context.stroke();
        context.beginPath();
        context.moveTo(x, y);
        strokes = 0;
      }
    }
    context.stroke();
    context.setLineDash([]);
  }

  area(points, fill) {
    const { context } = this;
    context.fillStyle = fill;
    context.beginPath();
    for (let k = 0; k < points.length; k += 2) {
      if (k === 0) context.moveTo(points[k], points[k + 1]);
      else context.lineTo(points[k], points[k + 1]);
    }
    context.closePath();
    context.fill();
  }

  marks(points, { colour, radius = 3, hollow = "" }) {
    const { context } = this;
    for (let k = 0; k < points.length; k += 2) {
      context.beginPath();
      context.arc(points[k], points[k + 1], radius, 0, 2 * Math.PI);
      context.fillStyle = hollow || colour;
      context.fill();
      context.strokeStyle = colour;
      context.lineWidth = 1.4;
      context.stroke();
    }
  }

  text(x, y, said, { colour, size = 12, align = "left", baseline = "alphabetic", turn = 0 }) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(turn);
    context.fillStyle = colour;
    context.font = `${size}px ${FONT}`;
    context.textAlign = align;
    context.textBaseline = baseline;
    context.fillText(said, 0, 0);
    context.restore();
  }

  width(said, size = 12) {
    this.context.font = `${size}px ${FONT}`;
    return this.context.measureText(said).width;
  }
}

const escaped = (said) => said.replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
const short = (value) => (Math.round(value * 100) / 100).toString();

let clips = 0; // The ids of clip paths must be unique in a page.

/** Pen that writes an SVG document. */
export class SvgPen {
  constructor(width, height, measure) {
    this.size = [width, height];
    this.parts = [];
    this.measure = measure;
  }

  rect(x, y, width, height, fill) {
    this.parts.push(
      `<rect x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}" fill="${fill}"/>`,
    );
  }

  clip(x, y, width, height) {
    clips += 1;
    const id = `clip${clips}`;
    this.parts.push(`<clipPath id="${id}"><rect x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}"/></clipPath>`);
    this.parts.push(`<g clip-path="url(#${id})">`);
  }

  unclip() {
    this.parts.push("</g>");
  }

  line(points, { colour, width = 1, dash = [] }) {
    const data = [];
    let down = false;
    for (let k = 0; k < points.length; k += 2) {
      const x = points[k];
      const y = points[k + 1];
      if (x !== x || y !== y) down = false;
      else {
        data.push(`${down ? "L" : "M"}${short(x)} ${short(y)}`);
        down = true;
      }
    }
    const dashed = dash.length ? ` stroke-dasharray="${dash.join(" ")}"` : "";
    this.parts.push(
      `<path d="${data.join("")}" fill="none" stroke="${colour}" stroke-width="${width}" stroke-linejoin="round"${dashed}/>`,
    );
  }

  area(points, fill) {
    const data = [];
    for (let k = 0; k < points.length; k += 2) data.push(`${short(points[k])},${short(points[k + 1])}`);
    this.parts.push(`<polygon points="${data.join(" ")}" fill="${fill}"/>`);
  }

  marks(points, { colour, radius = 3, hollow = "" }) {
    for (let k = 0; k < points.length; k += 2) {
      this.parts.push(
        `<circle cx="${short(points[k])}" cy="${short(points[k + 1])}" r="${radius}" fill="${hollow || colour}" stroke="${colour}" stroke-width="1.4"/>`,
      );
    }
  }

  text(x, y, said, { colour, size = 12, align = "left", baseline = "alphabetic", turn = 0 }) {
    const anchor = { left: "start", center: "middle", right: "end" }[align];
    const drop = { alphabetic: 0, middle: 0.35 * size, top: 0.8 * size, bottom: -0.2 * size }[baseline];
    const turned = turn ? ` transform="rotate(${short((turn * 180) / Math.PI)} ${short(x)} ${short(y)})"` : "";
    this.parts.push(
      `<text x="${short(x)}" y="${short(y)}" dy="${short(drop)}" font-size="${size}" fill="${colour}" text-anchor="${anchor}"${turned}>${escaped(said)}</text>`,
    );
  }

  width(said, size = 12) {
    return this.measure(said, size);
  }

  /** Return the document. */
  document() {
    const [width, height] = this.size;
    return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${width} ${height}" width="${width}" height="${height}" font-family="${escaped(FONT)}">${this.parts.join("\n")}</svg>\n`;
  }
}
