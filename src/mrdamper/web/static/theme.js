// Light and dark colours of the plots. A canvas cannot read the style sheet.

const COLOURS = {
	ink: ["#22282e", "#e4e8eb"],
	soft: ["#5b646d", "#9aa5ae"],
	grid: ["#eceff1", "#2a3138"],
	back: ["#ffffff", "#1a1f24"],
	measured: ["#89929a", "#7f8a93"],
	band: ["#e9edf0", "#2a3239"],
	outside: ["#f3e4de", "#43302b"],
	accent: ["#2f6794", "#7eb2dd"],
	colours: [
		"#2f6794 #c8553d #8a7420 #75588f #2c7f73 #a04a72 #55616c #7a8f2a",
		"#7eb2dd #e8836b #d0b451 #b79bd3 #62bfae #e08fb4 #a9b5bf #b5cc62",
	].map((row) => row.split(" ")),
	ramp: ["#2f5f98 #3f8f94 #8f9a3a #bf7d22 #c2412d", "#74a7e0 #62bfb6 #bcc767 #ecae55 #ee7560"].map(
		(row) => row.split(" "),
	),
};
const [LIGHT, DARK] = [0, 1].map((k) =>
	Object.fromEntries(Object.entries(COLOURS).map(([name, pair]) => [name, pair[k]])),
);

export const dark = window.matchMedia("(prefers-color-scheme: dark)");

export const palette = (forPaper = false) => (dark.matches && !forPaper ? DARK : LIGHT);

/** Return the colour at a fraction (0 to 1) of the ramp from low to high. */
export function rampColour(fraction, { ramp }) {
	const at = Math.min(1, Math.max(0, fraction)) * (ramp.length - 1);
	const k = Math.min(ramp.length - 2, Math.floor(at));
	return `color-mix(in srgb, ${ramp[k + 1]} ${100 * (at - k)}%, ${ramp[k]})`;
}
