// The page's parts, joined.
"use strict";

const byId = (id) => document.getElementById(id);

function addRows(list, rows) {
  for (const [label, text] of rows) list.append(element("dt", label), element("dd", text));
}

function addLegend(list) {
  const entries = [], isHit = flight.live || flight.recovering.length > 0;
  if (isHit) entries.push(["--red", "recovering"]);
  modeNames.forEach((mode, number) => entries.push([MODE_COLOURS[(number + 1) % MODE_COLOURS.length], mode]));
  if (flight.has_places) entries.push(["--ink", "◆ setpoint"]);
  if (flight.has_places && isHit) entries.push(["--red", "➤ normal, with its cone"]);
  if (flight.surfaces.length) entries.push(["--purple", "▱ remembered"]);
  if (flight.obstacles.length) entries.push(["--stone", "▰ obstacle"]);
  if (tables.truth && flight.has_places) entries.push(["--grey", "where it really was"]);
  list.replaceChildren(...entries.map(([variable, text]) => {
    const entry = element("li");
    const swatch = element("span", "", "swatch");
    swatch.style.background = colour(variable);
    entry.append(swatch, element("span", text));
    return entry;
  }));
}

function readout(time) {
  const speed = at(tables.path, ["vn", "ve", "vd"], time);
  const place = at(tables.path, ["n", "e", "d"], time);
  const rows = [`${isRecovering(time) ? "recovering, " : ""}${modeAt(time) || "mode unknown"}`];
  if (speed) rows.push(`${Math.hypot(...speed).toFixed(2)} m/s`);
  if (place) rows.push(`north ${place[0].toFixed(2)}  east ${place[1].toFixed(2)}  up ${(-place[2]).toFixed(2)} m`);
  return rows.join("\n");
}

function csvOf(table) {
  const names = Object.keys(table.columns);
  const lines = [names.map((name) => (UNITS[name] ? `${name} [${UNITS[name]}]` : name)).join(",")];
  for (let row = 0; row < table.length; row += 1) {
    lines.push(names.map((name) => {
      const value = table.columns[name][row];
      return Number.isFinite(value) ? String(Number(value.toFixed(6))) : "";
    }).join(","));
  }
  return `${lines.join("\n")}\n`;
}

function addDownload(list, name, about, text) {
  const entry = element("li");
  const button = element("button", name);
  button.type = "button";
  button.addEventListener("click", () => {
    const link = element("a");
    link.href = URL.createObjectURL(new Blob([text()], { type: "text/plain" }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  });
  entry.append(button, element("span", about));
  list.append(entry);
}

function addDownloads(list) {
  const stem = flight.name.replace(/[^A-Za-z0-9_.-]+/g, "-") || "flight";
  for (const [name, table] of Object.entries(tables).filter(([, { of }]) => flight.live || of > 0)) {
    const rows = table.length === table.of ? `${table.of} rows` : `${table.length} of ${table.of} rows: all round the hits, the loudest elsewhere`;
    addDownload(list, `${stem}-${name}.csv`, rows, () => csvOf(table));
  }
  addDownload(list, `${stem}-events.json`, `${flight.events.length} events`, () => JSON.stringify(flight.events, null, 2));
  if (flight.summary) addDownload(list, `${stem}-summary.json`, "the summary", () => JSON.stringify(flight.summary, null, 2));
}

function addEvents(body, events, goTo) {
  for (const event of events) {
    const row = element("tr");
    row.append(element("td", event.t.toFixed(3)), element("td", event.kind), element("td", event.text));
    row.addEventListener("click", () => goTo(event.t));
    body.append(row);
  }
}

function addAbout() {
  addRows(byId("versions"), Object.entries(flight.versions || {}));
  for (const library of flight.libraries) {
    const details = element("details");
    details.append(element("summary", `${library.name} ${library.version}, ${library.licence} licence, unchanged`), element("pre", library.licence_text));
    byId("licences").append(details);
  }
}

const KINDS = { hit: "hit", contact: "touch", missed: "not seen", closest: "closest call" };
let shownMoment = Math.max(0, flight.moments.findIndex((moment) => moment.kind === "hit"));

function showMoment(number) {
  const moment = flight.moments[number];
  shownMoment = number;
  [...byId("tabs").children].forEach((tab, index) => tab.setAttribute("aria-pressed", String(index === number)));
  byId("moment-title").textContent = `${moment.t.toFixed(3)} s: ${moment.title}`;
  byId("facts").replaceChildren();
  addRows(byId("facts"), moment.facts);
  byId("reasons").replaceChildren(...moment.reasons.map((reason) => element("li", reason)));
  const touch = moment.touched_ms === null ? "" : ", dashed: the first touch, as the simulator knows it";
  byId("chart-hint").textContent = `Upright line: the moment${touch}. Each sample stands at the end of the time that it is the mean of, which its bar shows. Grey: samples lost or not sent. Drag over a chart to come nearer, click twice to go back.`;
  addMicroscope(byId("charts"), moment);
}

function start() {
  byId("name").textContent = flight.name;
  byId("sentence").textContent = flight.sentence;
  byId("lines").append(...flight.lines.map((line) => element("li", line)));
  for (const [heading, text] of Object.entries(flight.headings || {})) byId(heading).textContent = text;
  for (const part of flight.hides || []) document.querySelector(`[aria-labelledby="${part}"]`).hidden = true;
  for (const control of [byId("before"), byId("after"), byId("slow").parentElement]) control.hidden = !flight.moments.length;
  addRows(byId("link"), flight.link);
  addAbout();

  let scene = null;
  try {
    scene = makeScene(byId("scene"));
  } catch (error) {
    byId("no-scene").hidden = false;
    byId("no-scene").textContent = `No replay in three dimensions here: ${error.message}`;
  }
  let overview = { showNow: () => {}, refill: () => {} };
  const scrubber = byId("scrubber");
  Object.assign(scrubber, { min: 0, max: flight.duration_s, step: 0.001 });
  const player = makePlayer((time) => {
    if (scene) scene.show(time);
    overview.showNow(time);
    scrubber.value = time;
    byId("clock").textContent = `${time.toFixed(3)} s of ${flight.duration_s.toFixed(1)} s`;
    byId("play").textContent = player.isPlaying ? "Pause" : "Play";
    byId("readout").textContent = readout(time);
  });

  const choose = (number) => {
    showMoment(number);
    player.seek(flight.moments[number].t);
  };
  const hop = (forward) => {
    const number = player.hop(forward);
    if (number >= 0) showMoment(number);
  };
  flight.moments.forEach((moment, number) => {
    const tab = element("button", `${moment.t.toFixed(1)} s ${KINDS[moment.kind]}`);
    tab.type = "button";
    tab.addEventListener("click", () => choose(number));
    byId("tabs").append(tab);
  });
  scrubber.addEventListener("input", () => player.seek(Number(scrubber.value)));
  byId("play").addEventListener("click", () => player.play(!player.isPlaying));
  byId("before").addEventListener("click", () => hop(false));
  byId("after").addEventListener("click", () => hop(true));
  byId("speed").addEventListener("change", (changed) => { player.speed = Number(changed.target.value); });
  byId("slow").addEventListener("change", (changed) => { player.slows = changed.target.checked; });
  const follow = (follows) => {
    byId("follow").checked = follows;
    if (scene) scene.view.follows = follows;
    player.seek(player.time);
  };
  byId("follow").addEventListener("change", (changed) => follow(changed.target.checked));
  onKeys(player, {
    hop,
    follow: () => follow(!byId("follow").checked),
    nearer: (factor) => scene && scene.view.nearer(factor),
  });
  addEvents(byId("events"), flight.events, (time) => player.seek(time));
  addDownloads(byId("downloads"));

  const redraw = () => {
    for (const id of ["overview", "charts", "link-charts"]) removeCharts(byId(id));
    addLegend(byId("legend"));
    overview = addOverview(byId("overview"), player.seek);
    addLink(byId("link-charts"));
    if (flight.moments.length) showMoment(shownMoment);
    if (scene) scene.restyle();
    player.seek(player.time);
  };
  if (!flight.moments.length) byId("moment-title").textContent = "Nothing was watched, so nothing came near a hit.";
  player.time = flight.moments.length ? flight.moments[shownMoment].t : 0;
  redraw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  let width = window.innerWidth;
  window.addEventListener("resize", () => {
    if (scene) scene.draw();
    if (window.innerWidth !== width) fitCharts();
    width = window.innerWidth;
    overview.showNow(player.time);
  });
  // Paper is white, whatever the screen is.
  for (const [event, isPrinted] of [["beforeprint", true], ["afterprint", false]]) {
    window.addEventListener(event, () => {
      document.documentElement.classList.toggle("printed", isPrinted);
      redraw();
    });
  }
  return { player, scene, scrubber, overview: () => overview };
}

const shown = start();
