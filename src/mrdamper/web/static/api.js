// Requests to the server: JSON and binary answers.

/** Error of a refused request; `message` is for the user. */
export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

const part = encodeURIComponent;

/** Prefix of all addresses of the damper; empty for the server's own folder. */
export const DAMPER = window.location.pathname.match(/^\/damper\/[^/]+/)?.[0] ?? "";
export const DAMPER_NAME = decodeURIComponent(DAMPER.split("/")[2] ?? "");

async function send(method, path, { body, raw, signal } = {}) {
  const options = { method, signal, body: raw, headers: {} };
  if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers["Content-Type"] = "application/json";
  }
  const response = await fetch(DAMPER + path, options).catch((fault) => {
    if (fault.name === "AbortError") throw fault;
    throw new Refused("The server does not answer. Is `mrdamper serve` still running?", 0);
  });
  if (response.ok) return response;
  const answer = await response.json().catch(() => ({}));
  throw new Refused(
    answer.error ?? `The server answered with status ${response.status}.`,
    response.status,
  );
}

const json = async (method, path, options) => (await send(method, path, options)).json();
const get = (path, signal) => json("GET", path, { signal });
const remove = (kind) => (name) => json("DELETE", `/api/${kind}/${part(name)}`);
const put =
  (kind) =>
  (file, name = file.name) =>
    json("PUT", `/api/${kind}/${part(name)}`, { raw: file });
const query = (values) =>
  new URLSearchParams(Object.entries(values).filter(([, value]) => (value ?? "") !== ""));

export const getState = () => get("/api/state");
export const getForms = () => get("/api/forms");
export const getChanges = () => get("/api/changes");
export const getRuns = () => get("/api/runs");
export const getData = () => get("/api/data");

export const getDampers = () => get("/api/workspaces");
export const addDamper = (name) => json("POST", "/api/workspaces", { body: { name } });
export const deleteDamper = remove("workspaces");

export const look = (name, signal) => get(`/api/files/${part(name)}/look`, signal);
export const glance = (name, signal) => get(`/api/files/${part(name)}/look?head=1`, signal);
export const putChannels = (asked, signal) => json("PUT", "/api/channels", { body: asked, signal });
export const putFile = put("files");
export const deleteFile = remove("files");

export const getGeometry = (name, signal) => get(`/api/dampers/${part(name)}`, signal);
export const putGeometry = (base, asked, signal) =>
  json("POST", `/api/dampers/${part(base)}`, { body: asked, signal });
export const heatCurve = (asked, signal) =>
  json("POST", "/api/heat/curve", { body: asked, signal });

export const putInput = put("inputs");
export const deleteInput = remove("inputs");
export const inputFile = (name) => `${DAMPER}/api/inputs/${part(name)}`;

export const getCard = (name) => get(`/api/cards/${part(name)}`);
export const putCard = put("cards");
export const deleteCard = remove("cards");
export const cardFile = (name, path) => `${DAMPER}/api/cards/${part(name)}/files/${part(path)}`;

export const getJob = (id) => get(`/api/jobs/${part(id)}`);
export const startJob = (kind, options) => json("POST", "/api/jobs", { body: { kind, options } });
export const cancelJob = (id) => json("POST", `/api/jobs/${part(id)}/cancel`, { body: {} });
export const resumeJob = (id) => json("POST", `/api/jobs/${part(id)}/resume`, { body: {} });
export const deleteJob = remove("jobs");
export const jobFile = (id, path, download = false) =>
  `${DAMPER}/api/jobs/${part(id)}/files/${path.split("/").map(part).join("/")}${download ? "?download=1" : ""}`;

export const getTrash = () => get("/api/trash");
export const restore = (id) => json("POST", `/api/trash/${part(id)}/restore`, { body: {} });
export const emptyTrash = () => json("DELETE", "/api/trash");

/** Return the channels of a run, or the force of a card at its samples: `{head, columns: {time_s, force_N, ...}}`. */
export async function samples(run, card, { max, from, to, signal } = {}) {
  const asked = query({ card, file: run.file, max, from_s: from, to_s: to });
  const path = `/api/runs/${part(run.name)}/${card ? "model" : "series"}?${asked}`;
  const buffer = await (await send("GET", path, { signal })).arrayBuffer();
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const column = ({ name }, k) => [
    name,
    new Float32Array(buffer, 4 + length + 4 * head.n * k, head.n),
  ];
  return { head, columns: Object.fromEntries(head.columns.map(column)) };
}
