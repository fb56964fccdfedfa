// Light and dark colours of the plots. A canvas cannot read the style sheet.

const LIGHT = {
  ink: "#22282e",
  soft: "#5b646d",
  grid: "#eceff1",
  back: "#ffffff",
  measured: "#89929a",
  band: "#e9edf0",
  outside: "#f3e4de",
  accent: "#2f6794",
  colours: ["#2f6794", "#c8553d", "#8a7420", "#75588f", "#2c7f73", "#a04a72", "#55616c", "#7a8f2a"],
  ramp: ["#2f5f98", "#3f8f94", "#8f9a3a", "#bf7d22", "#c2412d"],
};
const DARK = {
  ink: "#e4e8eb",
  soft: "#9aa5ae",
  grid: "#2a3138",
  back: "#1a1f24",
  measured: "#7f8a93",
  band: "#2a3239",
  outside: "#43302b",
  accent: "#7eb2dd",
  colours: ["#7eb2dd", "#e8836b", "#d0b451", "#b79bd3", "#62bfae", "#e08fb4", "#a9b5bf", "#b5cc62"],
  ramp: ["#74a7e0", "#62bfb6", "#bcc767", "#ecae55", "#ee7560"],
};

export const dark = window.matchMedia("(prefers-color-scheme: dark)");

export const palette = (forPaper = false) => (dark.matches && !forPaper ? DARK : LIGHT);

/** Return the colour at a fraction (0 to 1) of the ramp from low to high. */
export function rampColour(fraction, { ramp }) {
  const at = Math.min(1, Math.max(0, fraction)) * (ramp.length - 1);
  const k = Math.min(ramp.length - 2, Math.floor(at));
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const [low, high] = [rgb(ramp[k]), rgb(ramp[k + 1])];
  const mixed = low.map((value, i) => Math.round(value + (high[i] - value) * (at - k)));
  return `rgb(${mixed.join(" ")})`;
}
