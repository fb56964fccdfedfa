// Shared worker of a browser with the event streams for all tabs of one server.

import { Streams } from "./streams.js";

const streams = new Streams();

self.addEventListener("connect", ({ ports: [port] }) => {
  const hearing = new Map();
  port.addEventListener("message", ({ data: { key, of, leave } }) => {
    if (leave) {
      streams.leave(hearing.get(key));
      hearing.delete(key);
      return;
    }
    const hear = (name, data) => port.postMessage({ key, name, data });
    hearing.set(key, hear);
    if (of) streams.follow(of, hear);
    else streams.watch(hear);
  });
  port.start();
});
