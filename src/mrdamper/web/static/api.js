// Requests to the server: JSON and binary answers.

/** Prefix of all request addresses of a damper in `dampers/`. */
export const DAMPER = window.location.pathname.match(/^\/damper\/[^/]+/)?.[0] ?? "";
export const DAMPER_NAME = decodeURIComponent(DAMPER.split("/")[2] ?? "");

/** Return the address of a request, such as at`cards/${name}`; names are encoded. */
export const at = (texts, ...names) =>
	`${DAMPER}/api/${String.raw({ raw: texts }, ...names.map(encodeURIComponent))}`;

async function send(method, address, { body, raw, signal } = {}) {
	const headers = body ? { "Content-Type": "application/json" } : {};
	const options = { method, signal, body: body ? JSON.stringify(body) : raw, headers };
	const response = await fetch(address, options).catch((fault) => {
		if (fault.name === "AbortError") throw fault;
		throw new Error("The server does not answer. Is `mrdamper serve` still running?");
	});
	if (response.ok) return response;
	const { error } = await response.json().catch(() => ({}));
	throw new Error(error ?? `The server answered with status ${response.status}.`);
}

const json = async (...request) => (await send(...request)).json();
export const get = (address, signal) => json("GET", address, { signal });
export const post = (address, body = {}) => json("POST", address, { body });
export const put = (address, options) => json("PUT", address, options);
export const remove = (address) => json("DELETE", address);

/** Return the channels of a run, or with a card its modelled force: `{head, columns: {force_N, ...}}`. */
export async function samples(run, card, { signal, ...limits } = {}) {
	const values = { card, file: run.file, ...limits };
	const known = Object.entries(values).filter(([, value]) => (value ?? "") !== "");
	const path = at`runs/${run.name}/${card ? "model" : "series"}`;
	const response = await send("GET", `${path}?${new URLSearchParams(known)}`, { signal });
	const buffer = await response.arrayBuffer();
	const length = new DataView(buffer).getUint32(0, true);
	const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
	const valuesOf = (k) => new Float32Array(buffer, 4 + length + 4 * head.n * k, head.n);
	return {
		head,
		columns: Object.fromEntries(head.columns.map(({ name }, k) => [name, valuesOf(k)])),
	};
}
