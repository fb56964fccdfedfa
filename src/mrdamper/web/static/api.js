// Requests to the server: JSON and binary answers.

const part = encodeURIComponent;

/** Prefix of all request addresses of a damper in `dampers/`. */
export const DAMPER = window.location.pathname.match(/^\/damper\/[^/]+/)?.[0] ?? "";
export const DAMPER_NAME = decodeURIComponent(DAMPER.split("/")[2] ?? "");

async function send(method, path, { body, raw, signal } = {}) {
  const headers = body ? { "Content-Type": "application/json" } : {};
  const options = { method, signal, body: body ? JSON.stringify(body) : raw, headers };
  const response = await fetch(DAMPER + path, options).catch((fault) => {
    if (fault.name === "AbortError") throw fault;
    throw new Error("The server does not answer. Is `mrdamper serve` still running?");
  });
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({}));
  throw new Error(error ?? `The server answered with status ${response.status}.`);
}

const json = async (method, path, options) => (await send(method, path, options)).json();
const get = (path, signal) => json("GET", path, { signal });
const post = (path, body = {}, signal = undefined) => json("POST", path, { body, signal });
const remove = (kind) => (name) => json("DELETE", `/api/${kind}/${part(name)}`);
const put =
  (kind) =>
  (file, name = file.name) =>
    json("PUT", `/api/${kind}/${part(name)}`, { raw: file });
const pathOf = (path) => path.split("/").map(part).join("/");

export const getState = () => get("/api/state");
export const getForms = () => get("/api/forms");
export const getChanges = () => get("/api/changes");
export const getRuns = () => get("/api/runs");
export const getDampers = () => get("/api/workspaces");
export const addDamper = (name) => post("/api/workspaces", { name });
export const deleteDamper = remove("workspaces");
export const look = (name, signal) => get(`/api/files/${part(name)}/look`, signal);
export const glance = (name, signal) => get(`/api/files/${part(name)}/look?head=1`, signal);
export const putChannels = (body, signal) => json("PUT", "/api/channels", { body, signal });
export const putFile = put("files");
export const deleteFile = remove("files");
export const getGeometry = (name) => get(`/api/dampers/${part(name)}`);
export const putGeometry = (base, body) => post(`/api/dampers/${part(base)}`, body);
export const heatCurve = (body) => post("/api/heat/curve", body);
export const putInput = put("inputs");
export const deleteInput = remove("inputs");
export const inputFile = (name) => `${DAMPER}/api/inputs/${part(name)}`;
export const getCard = (name) => get(`/api/cards/${part(name)}`);
export const putCard = put("cards");
export const deleteCard = remove("cards");
export const cardFile = (name, path) => `${DAMPER}/api/cards/${part(name)}/files/${part(path)}`;
export const getJob = (id) => get(`/api/jobs/${part(id)}`);
export const startJob = (kind, options) => post("/api/jobs", { kind, options });
export const cancelJob = (id) => post(`/api/jobs/${part(id)}/cancel`);
export const resumeJob = (id) => post(`/api/jobs/${part(id)}/resume`);
export const deleteJob = remove("jobs");
export const jobFile = (id, path) => `${DAMPER}/api/jobs/${part(id)}/files/${pathOf(path)}`;
export const getTrash = () => get("/api/trash");
export const restore = (id) => post(`/api/trash/${part(id)}/restore`);
export const emptyTrash = () => json("DELETE", "/api/trash");

/** Return the channels of a run, or with a card its modelled force: `{head, columns: {force_N, ...}}`. */
export async function samples(run, card, { signal, ...limits } = {}) {
  const values = { card, file: run.file, ...limits };
  const known = Object.entries(values).filter(([, value]) => (value ?? "") !== "");
  const path = `/api/runs/${part(run.name)}/${card ? "model" : "series"}`;
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
