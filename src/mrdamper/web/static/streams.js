// The event streams of one browser, and who hears what: a browser has six connections to a server, however many
// tabs are open. Here is what the shared worker does; where there is none, each tab does it for itself.

const MOST_JOBS = 3; // streams of jobs at once; more wait for their turn
const NAMES = ["progress", "message", "end"];

/** The streams: of the folder with all its dampers, and of the jobs that somebody follows. */
export class Streams {
  constructor() {
    Object.assign(this, { folder: null, watchers: new Set(), jobs: new Map() });
  }

  /** Call `hear(name, data)` with each change in the folder, and when the server is lost or back. */
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

  /** Call `hear(name, data)` with all that a job says whose events have the address `id`, from its beginning. */
  follow(id, hear) {
    if (!this.jobs.has(id)) this.jobs.set(id, { source: null, told: [], heard: new Set() });
    const job = this.jobs.get(id);
    job.heard.add(hear);
    for (const [name, data] of job.told) hear(name, data);
    this.open();
  }

  /** Forget who hears. */
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

  /** Open streams of jobs that have none, as many as there may be. */
  open() {
    for (const [id, job] of this.jobs) {
      const busy = [...this.jobs.values()].filter((each) => each.source).length;
      if (job.source || busy >= MOST_JOBS) continue;
      job.source = new EventSource(id);
      for (const name of NAMES) {
        job.source.addEventListener(name, (event) => {
          if (!event.data) return; // an error of the connection has this name in old browsers
          const data = JSON.parse(event.data);
          job.told.push([name, data]);
          for (const hear of [...job.heard]) hear(name, data);
          if (name === "end") this.close(id);
        });
      }
    }
  }
}
