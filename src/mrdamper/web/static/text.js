// Numbers as texts, lists, and files that the browser saves.

export const has = (value) => value !== null && value !== undefined;

/** Return a list without `value`, or with `value` if it was missing. */
export const toggled = (values, value) =>
	values.includes(value) ? values.filter((one) => one !== value) : [...values, value];

export const fixed = (value, decimals = 1) =>
	Number.isFinite(value) ? value.toFixed(decimals).replace("-", "−") : "–";

export function number(value, digits = 3) {
	if (!Number.isFinite(value)) return "–";
	const size = Math.abs(Number(value.toPrecision(digits)));
	if (size && (size >= 1e5 || size < 1e-3))
		return value
			.toExponential(digits - 1)
			.replace("e+", "e")
			.replace("-", "−");
	return size ? fixed(value, Math.max(0, digits - 1 - Math.floor(Math.log10(size)))) : "0";
}

export const counted = (count) => (count ?? 0).toLocaleString("en-GB").replaceAll(",", " ");

export const several = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

export function duration(seconds) {
	if (!Number.isFinite(seconds)) return "–";
	if (seconds < 120) return `${fixed(seconds, seconds < 10 ? 1 : 0)} s`;
	const minutes = Math.floor(seconds / 60);
	if (minutes < 120) return `${minutes} min ${Math.round(seconds - 60 * minutes)} s`;
	return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export function bytes(count) {
	const power = Math.min(3, Math.floor(Math.log10(Math.max(1, count)) / 3));
	return `${(count / 1e3 ** power).toFixed(power > 1 ? 1 : 0)} ${["B", "kB", "MB", "GB"][power]}`;
}

export function save(name, blob) {
	const href = URL.createObjectURL(blob);
	Object.assign(document.createElement("a"), { href, download: name }).click();
	setTimeout(() => URL.revokeObjectURL(href), 10000);
}

export function csvText(rows) {
	const guarded = (text) => (/^[=+\-@\t\r]/.test(text) ? `'${text}` : text); // A spreadsheet would evaluate the text.
	const cell = (value) => {
		if (typeof value === "string") return `"${guarded(value).replaceAll('"', '""')}"`;
		return Number.isFinite(value) ? String(Number(Number(value).toPrecision(9))) : "";
	};
	return rows.map((row) => `${row.map(cell).join(",")}\n`);
}
