// Elements and controls of the pages. All text is inserted as text, never as markup.

import { choose, chosen } from "./state.js";
import { h } from "./vendor/preact.js";

const isProps = (value) =>
	value !== null && typeof value === "object" && value.constructor === Object;

const element =
	(name, look) =>
	(first, ...rest) => {
		const props = isProps(first) ? first : null;
		const all = look ? { class: look, ...props } : props;
		return props ? h(name, all, ...rest) : h(name, all, first, ...rest);
	};

/** Functions that create elements: `p("text")`, `p.small("text")` with a class, `p({id: "words"}, "text")`. */
export const tags = new Proxy(
	{},
	{ get: (_, name) => new Proxy(element(name), { get: (_tag, look) => element(name, look) }) },
);
const { a, div, input, label, option, span } = tags;

/** Return a button; `about`: its name for a screen reader, or its properties. */
export const button = (text, onclick, look = "", about = {}) => {
	const props = typeof about === "string" ? { "aria-label": about } : about;
	return tags.button({ type: "button", class: look, onclick, ...props }, text);
};

export const opening = (href, text, props = {}) =>
	a({ href, target: "_blank", rel: "noopener", ...props }, text);

export const field = (words, control, unit = "") =>
	div.field(label({ for: control.props.id }, unit ? `${words}, ${unit}` : words), control);

/** Return a drop-down list of texts or `[value, text]` pairs. */
export const select = (options, value, change, props = {}) =>
	tags.select(
		{ ...props, value, onchange: (event) => change(event.target.value) },
		options
			.map((one) => (Array.isArray(one) ? one : [one, one]))
			.map(([key, text]) => option({ value: key, key, selected: key === value }, text)),
	);

/** Return a drop-down list for a choice; its first option is the default. With `step`, Back undoes a change. */
export const choice = (words, key, options, step = false) => {
	const change = (value) => choose({ [key]: value || null }, step);
	return field(words, select(options, chosen(key, ""), change, { id: key.replace(".", "-") }));
};

export const textField = (words, value, change, props) =>
	field(
		words,
		input({ type: "text", value, oninput: (event) => change(event.target.value), ...props }),
	);

export const search = (words, key, placeholder) => {
	const change = (text) => choose({ [key]: text || null });
	return textField(words, chosen(key, ""), change, {
		type: "search",
		id: key.replace(".", "-"),
		placeholder,
	});
};

export const check = (text, checked, change, props = {}) =>
	label(
		{ class: "check", key: text },
		input({
			type: "checkbox",
			checked,
			onchange: (event) => change(event.target.checked),
			...props,
		}),
		span(text),
	);

export function filePicker(words, accept, taken, look = "quiet", props = {}) {
	const onchange = (event) => {
		const files = [...event.target.files];
		event.target.value = ""; // Reset, so that the same file can be chosen again.
		taken(files);
	};
	const open = (event) => event.target.nextElementSibling.click();
	const about = { type: "file", accept, hidden: true, onchange, "aria-label": words, ...props };
	return span(button(words, open, look), input(about));
}

/** Make the Tab key stop only once in a list; arrow keys, Home and End move inside the list. */
export function rove(place) {
	if (!place) return;
	const all = () =>
		[...place.querySelectorAll("button, a[href], input")].filter((one) => !one.disabled);
	const settle = (at) => all().forEach((one) => (one.tabIndex = one === at ? 0 : -1));
	settle(place.contains(document.activeElement) ? document.activeElement : all()[0]);
	place.onkeydown = (event) => {
		const items = all();
		const at = items.indexOf(event.target);
		const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
		const next = { Home: items[0], End: items.at(-1) }[event.key] ?? (step && items[at + step]);
		if (!next) return;
		event.preventDefault();
		settle(next);
		next.focus();
	};
}
