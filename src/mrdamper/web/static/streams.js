// Event streams of one browser and their listeners. A browser opens at most six connections to a server for all its
// tabs, so a shared worker holds the streams. Without a shared worker each tab has its own streams.

const MOST_JOBS = 3; // Open streams of jobs; further jobs wait.
const NAMES = ["progress", "message", "end"];

/** Streams of the folder and of the followed jobs. */
export class Streams {
  constructor() {
    Object.assign(this, { folder: null, watchers: new Set(), jobs: new Map() });
  }

  /** Call `hear(name, data)` for each change in the folder and each change of the connection. */
  watch(hear) {
    this.watchers.add(hear);
    if (this.folder?.readyState === EventSource.OPEN) hear("open", null);
    if (this.folder && this.folder.readyState !== EventSource.CLOSED) return;
    this.folder = new EventSource("/api/events");
    const tell = (name, data) => this.watchers.forEach((each) => each(name, data));
    this.folder.addEventListener("changed", (event) => tell("changed", JSON.parse(event.data)));
    this.folder.addEventListener("open", () => tell("open", null));
    this.folder.addEventListener("error", () => {
      tell("lost", null);
      if (this.folder.readyState === EventSource.CLOSED) setTimeout(() => this.watchers.size && this.watch(hear), 2000);
    });
  }

  /** Call `hear(name, data)` for all events of a job from its beginning; `id` is the address of its events. */
  follow(id, hear) {
    if (!this.jobs.has(id)) this.jobs.set(id, { source: null, told: [], heard: new Set() });
    const job = this.jobs.get(id);
    job.heard.add(hear);
    for (const [name, data] of job.told) hear(name, data);
    this.open();
  }

  /** Remove a listener. */
  leave(hear) {
    this.watchers.delete(hear);
    for (const [id, job] of this.jobs) {
      if (job.heard.delete(hear) && !job.heard.size) this.close(id);
    }
    if (!this.watchers.size) {
      this.folder?.close();
      this.folder = null;
    }
  }

  close(id) {
    this.jobs.get(id)?.source?.close();
    this.jobs.delete(id);
    this.open();
  }

  /** Open the streams of waiting jobs up to the limit. */
  open() {
    for (const [id, job] of this.jobs) {
      const busy = [...this.jobs.values()].filter((each) => each.source).length;
      if (job.source || busy >= MOST_JOBS) continue;
      job.source = new EventSource(id);
      for (const name of NAMES) {
        job.source.addEventListener(name, (event) => {
          if (!event.data) return; // Old browsers use this name for connection errors.
          const data = JSON.parse(event.data);
          job.told.push([name, data]);
          for (const hear of [...job.heard]) hear(name, data);
          if (name === "end") this.close(id);
        });
      }
    }
  }
}
