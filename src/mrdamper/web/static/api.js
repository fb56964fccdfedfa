// Requests to the server: JSON and binary answers, repeated requests for slow answers, and events.

import { Streams } from "./streams.js";

/** Error of a refused request; `message` is for the user. */
export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

const TRIES = 400;
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const part = encodeURIComponent;

/** Prefix of all addresses of the damper; empty for the server's own folder. */
export const DAMPER = window.location.pathname.match(/^\/damper\/[^/]+/)?.[0] ?? "";
export const DAMPER_NAME = decodeURIComponent(DAMPER.split("/")[2] ?? "");

/** Send a request, and repeat it while the status is 202, until `signal` aborts it. */
async function send(method, address, { body = null, raw = null, signal = null } = {}) {
  const options = { method, signal, headers: {} };
  if (raw !== null) options.body = raw;
  else if (body !== null) {
    options.body = JSON.stringify(body);
    options.headers["Content-Type"] = "application/json";
  }
  for (let k = 0; k < TRIES; k += 1) {
    let response;
    try {
      response = await fetch(DAMPER + address, options);
    } catch (fault) {
      if (fault.name === "AbortError") throw fault;
      throw new Refused("The server does not answer. Is `mrdamper serve` still running?", 0);
    }
    if (response.status === 202) {
      const told = await response.json();
      await pause(told.retry_ms ?? 300);
      if (signal?.aborted) throw new DOMException("no longer wanted", "AbortError");
      continue;
    }
    if (!response.ok) throw new Refused(await words(response), response.status);
    return response;
  }
  throw new Refused(`${address}: no answer after many tries`, 0);
}

async function words(response) {
  try {
    const told = await response.json();
    return told.error || `the server answered ${response.status}`;
  } catch {
    return `the server answered ${response.status}`;
  }
}

const json = async (method, address, options) => (await send(method, address, options)).json();

export const getState = () => json("GET", "/api/state");
export const getForms = () => json("GET", "/api/forms");
export const getDampers = () => json("GET", "/api/workspaces");
export const addDamper = (name) => json("POST", "/api/workspaces", { body: { name } });
export const deleteDamper = (name) => json("DELETE", `/api/workspaces/${part(name)}`);
export const getJob = (id) => json("GET", `/api/jobs/${part(id)}`);
export const getDamper = (name, signal) => json("GET", `/api/dampers/${part(name)}`, { signal });
export const drawDamperOf = (base, asked, signal) => json("POST", `/api/dampers/${part(base)}`, { body: asked, signal });
export const look = (name, signal) => json("GET", `/api/files/${part(name)}/look`, { signal });
export const glance = (name, signal) => json("GET", `/api/files/${part(name)}/look?head=1`, { signal });
export const deleteFile = (name) => json("DELETE", `/api/files/${part(name)}`);
export const getCard = (name) => json("GET", `/api/cards/${part(name)}`);
export const deleteCard = (name) => json("DELETE", `/api/cards/${part(name)}`);
export const deleteJob = (id) => json("DELETE", `/api/jobs/${part(id)}`);
export const getTrash = () => json("GET", "/api/trash");
export const restore = (id) => json("POST", `/api/trash/${part(id)}/restore`, { body: {} });
export const emptyTrash = () => json("DELETE", "/api/trash");
export const putChannels = (asked, signal) => json("PUT", "/api/channels", { body: asked, signal });
export const putFile = (file) => json("PUT", `/api/files/${part(file.name)}`, { raw: file });
export const putInput = (file) => json("PUT", `/api/inputs/${part(file.name)}`, { raw: file });
export const deleteInput = (name) => json("DELETE", `/api/inputs/${part(name)}`);
export const inputFile = (name) => `${DAMPER}/api/inputs/${part(name)}`;
export const putCard = (name, file) => json("PUT", `/api/cards/${part(name)}`, { raw: file });
export const startJob = (kind, options) => json("POST", "/api/jobs", { body: { kind, options } });
export const cancelJob = (id) => json("POST", `/api/jobs/${part(id)}/cancel`, { body: {} });
export const resumeJob = (id) => json("POST", `/api/jobs/${part(id)}/resume`, { body: {} });
export const getData = () => json("GET", "/api/data");
export const heatCurve = (asked, signal) => json("POST", "/api/heat/curve", { body: asked, signal });
export const jobFile = (id, path, download = false) =>
  `${DAMPER}/api/jobs/${part(id)}/files/${path.split("/").map(part).join("/")}${download ? "?download=1" : ""}`;
export const cardFile = (name, path) => `${DAMPER}/api/cards/${part(name)}/files/${part(path)}`;

function query(values) {
  const told = Object.entries(values).filter(([, value]) => value !== null && value !== undefined && value !== "");
  return told.length ? `?${new URLSearchParams(told.map(([key, value]) => [key, String(value)]))}` : "";
}

export const getRuns = () => json("GET", "/api/runs");

/** Return the channels of a run as typed arrays: `{head, columns: {time_s, force_N, ...}}`. */
export async function series(run, { max = null, from = null, to = null, file = null, signal = null } = {}) {
  const asked = query({ max, from_s: from, to_s: to, file });
  const response = await send("GET", `/api/runs/${part(run)}/series${asked}`, { signal });
  return unpack(await response.arrayBuffer());
}

/** Return the modelled force at the samples of a run in the same format. */
export async function modelled(run, card, { max = null, from = null, to = null, file = null, signal = null } = {}) {
  const asked = query({ card, max, from_s: from, to_s: to, file });
  const response = await send("GET", `/api/runs/${part(run)}/model${asked}`, { signal });
  return unpack(await response.arrayBuffer());
}

/** Parse a binary answer: length, header in JSON, columns of float32. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const columns = {};
  head.columns.forEach((column, k) => {
    columns[column.name] = new Float32Array(buffer, 4 + length + 4 * head.n * k, head.n);
  });
  return { head, columns };
}

let worker = null;
let own = null; // Used if the shared worker is missing or could not be loaded.
const hearing = new Map();
let keys = 0;

/** Listen to the events of a job or of the folder; return a function that stops listening. */
function hear(of, heard) {
  keys += 1;
  const key = keys;
  hearing.set(key, { of, heard });
  if (typeof SharedWorker === "undefined") own ??= new Streams();
  else if (!own) worker ??= shared();
  if (own) hearOwn(hearing.get(key));
  else worker.port.postMessage({ key, of });
  return () => {
    hearing.delete(key);
    own?.leave(heard);
    worker?.port.postMessage({ key, leave: true });
  };
}

function shared() {
  const made = new SharedWorker("/static/events_worker.js", { type: "module", name: "mrdamper-events" });
  made.port.addEventListener("message", ({ data }) => hearing.get(data.key)?.heard(data.name, data.data));
  made.port.start();
  made.addEventListener("error", () => {
    if (own) return;
    own = new Streams(); // The worker could not be loaded.
    hearing.forEach(hearOwn);
  });
  window.addEventListener("pagehide", () => [...hearing.keys()].forEach((key) => made.port.postMessage({ key, leave: true })));
  window.addEventListener("pageshow", (event) => event.persisted && window.location.reload());
  return made;
}

function hearOwn({ of, heard }) {
  if (of) own.follow(of, heard);
  else own.watch(heard);
}

/** Listen to the events of a job: `progress`, `message` and `end`. Return a function that stops listening. */
export const follow = (id, heard) => hear(`${DAMPER}/api/jobs/${part(id)}/events`, (name, data) => heard[name]?.(data));

/** Call `changed` after changes in the folder of this damper, and `reached` with the state of the connection. */
export function watchFolder(changed, reached) {
  const mine = ({ damper }) => damper === undefined || damper === DAMPER_NAME;
  hear(null, (name, data) => {
    if (name === "changed") mine(data) && changed(data.what ?? []);
    else reached(name === "open");
    if (name === "open") changed(["files", "records", "cards", "jobs", "inputs"]);
  });
}
