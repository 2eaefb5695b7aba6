// A flight while it is flown: rows and events as the server brings them.
"use strict";

const ENDS = ["done", "aborted", "failed"];

function goLive({ player, scene, scrubber, overview }) {
  const headline = byId("sentence");
  // Who looks back stays there, until the end of the scrubber is reached again.
  let follows = true;
  scrubber.addEventListener("input", () => { follows = Number(scrubber.value) > flight.duration_s - 0.5; });

  function take(chunk) {
    for (const [name, rows] of Object.entries(chunk.rows)) {
      const { columns } = tables[name];
      const names = Object.keys(columns);
      for (const row of rows) names.forEach((column, number) => columns[column].push(row[number] === null ? NaN : row[number]));
    }
    chunk.events.forEach(hear);
    addEvents(byId("events"), chunk.events, player.seek);
    flight.events.push(...chunk.events);
    flight.duration_s = Math.max(flight.duration_s, chunk.until);
    scrubber.max = flight.duration_s;
    overview().refill();
    if (scene) scene.restyle();
    // Charts have their new scales with the next frame.
    requestAnimationFrame(() => player.seek(follows ? flight.duration_s : player.time));
  }

  function hear(event) {
    if (event.kind === "mode" && event.text.startsWith("mode ")) {
      const mode = event.text.slice(5);
      flight.modes.push([event.t, mode]);
      if (!modeNames.includes(mode)) modeNames.push(mode);
      addLegend(byId("legend"));
    }
    const last = flight.recovering[flight.recovering.length - 1];
    if (last && last[1] === Infinity && ["recovered", "unconfirmed", "detection"].includes(event.kind)) last[1] = event.t;
    if (event.kind === "detection") flight.recovering.push([event.t, Infinity]);
    if (event.kind !== "STATUSTEXT") headline.textContent = event.text;
    if (ENDS.includes(event.kind)) headline.textContent = `${event.text}. The report tells more: rebound report.`;
  }

  const source = new EventSource("live");
  source.addEventListener("message", (message) => take(JSON.parse(message.data)));
  source.addEventListener("open", () => {
    // The server tells everything from the beginning, also to whom it had lost.
    for (const table of Object.values(tables)) for (const column of Object.values(table.columns)) column.length = 0;
    for (const list of [flight.events, flight.modes, flight.recovering]) list.length = 0;
    byId("events").replaceChildren();
    headline.textContent = "Waiting for the flight.";
  });
  source.addEventListener("error", () => { headline.textContent = "The watch is over, or out of reach; asking again."; });
}

if (flight.live) goLive(shown);
