// Light and dark colours of the plots, and the switch. The style sheet contains the colours of the page; canvases cannot read
// them, so that their colours are defined here.

const LIGHT = {
  ink: "#22282e",
  soft: "#5b646d",
  line: "#c9ced3",
  grid: "#eceff1",
  back: "#ffffff",
  measured: "#89929a",
  band: "#e9edf0",
  outside: "#f3e4de",
  brush: "rgba(47, 103, 148, 0.14)",
  accent: "#2f6794",
  colours: ["#2f6794", "#c8553d", "#8a7420", "#75588f", "#2c7f73", "#a04a72", "#55616c", "#7a8f2a"],
  ramp: ["#2f5f98", "#3f8f94", "#8f9a3a", "#bf7d22", "#c2412d"],
  volts: ["#5b3f8f", "#84479b", "#a84a86", "#b8506a", "#a8602f"],
};
const DARK = {
  ink: "#e4e8eb",
  soft: "#9aa5ae",
  line: "#4a545d",
  grid: "#2a3138",
  back: "#1a1f24",
  measured: "#7f8a93",
  band: "#2a3239",
  outside: "#43302b",
  brush: "rgba(126, 178, 221, 0.2)",
  accent: "#7eb2dd",
  colours: ["#7eb2dd", "#e8836b", "#d0b451", "#b79bd3", "#62bfae", "#e08fb4", "#a9b5bf", "#b5cc62"],
  ramp: ["#74a7e0", "#62bfb6", "#bcc767", "#ecae55", "#ee7560"],
  volts: ["#a996e0", "#c493dc", "#df92c4", "#ec96a8", "#e0a878"],
};

const KEY = "mrdamper-theme";
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const { dataset } = document.documentElement;

/** Return `light` or `dark`: the choice of the user, or the preference of the system. */
export const theme = () => dataset.theme ?? (dark.matches ? "dark" : "light");

/** Return the colours of the plots; with `forPaper` always the light ones. */
export const palette = (forPaper = false) => (forPaper || theme() === "light" ? LIGHT : DARK);

/** Return the colour at a fraction (0 to 1) of the ramp from low to high; volts have their own ramp. */
export function rampColour(fraction, colours = palette(), isVolts = false) {
  const ramp = isVolts ? colours.volts : colours.ramp;
  const at = Math.min(1, Math.max(0, fraction)) * (ramp.length - 1);
  const k = Math.min(ramp.length - 2, Math.floor(at));
  const [low, high] = ramp
    .slice(k, k + 2)
    .map((hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)));
  const mixed = low.map((value, i) => Math.round(value + (high[i] - value) * (at - k)));
  return `#${mixed.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

/** Restore the stored choice, and call `changed` after a change of the system. */
export function startTheme(changed) {
  const kept = localStorage.getItem(KEY);
  if (kept === "light" || kept === "dark") dataset.theme = kept;
  dark.addEventListener("change", changed);
}

/** Change between light and dark colours. */
export function switchTheme() {
  dataset.theme = theme() === "dark" ? "light" : "dark";
  localStorage.setItem(KEY, dataset.theme);
}
