// Charts by uPlot: with units, a legend below the data, windows of averaging and gaps where samples were lost.
"use strict";

const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
const MICROSCOPE_MS = 150;
const charts = [];

// A threshold and a contact a hundred times as hard in one picture; below a tenth all is quiet.
const QUIETEST = 0.1;
const POWERS = { distr: 3, range: (plot, low, high) => [QUIETEST, 10 ** Math.max(1, Math.ceil(Math.log10(high || 1)))] };

function powersOfTen(plot, number, low, high) {
  const powers = [];
  for (let power = QUIETEST; power <= high * 1.01; power *= 10) powers.push(power);
  return powers;
}

// Columns as uPlot takes them: null for "none".
function plotted(values) {
  return Array.from(values, (value) => (Number.isFinite(value) ? value : null));
}

// One chart. `series`: {label, values, colour, number, width, points}. `marks`: {at, colour} upright lines.
function addChart(parent, { title, unit, across, x, series, height = 180, marks = [], windowMs = 0, gaps = [], range, up = {} }) {
  const box = element("div", undefined, "chart");
  box.append(element("h5", `${title} [${unit}]`));
  parent.append(box);
  const options = {
    width: widthOf(box),
    height,
    scales: { x: { time: false, ...(range ? { min: range[0], max: range[1] } : {}) }, y: up },
    cursor: { drag: { x: true, y: false } },
    axes: [{ ...axis(), size: 34 }, { ...axis(), size: 56, ...(up === POWERS ? { splits: powersOfTen } : {}) }],
    series: [{ label: across }, ...series.map(lineOf)],
    hooks: {
      drawClear: [(plot) => shadeGaps(plot, gaps)],
      draw: [(plot) => drawWindows(plot, windowMs), (plot) => drawMarks(plot, marks)],
    },
  };
  const plot = new uPlot(options, [x, ...series.map((one) => one.values)], box);
  const chart = { plot, box, parent };
  charts.push(chart);
  return chart;
}

function widthOf(box) {
  return Math.max(200, box.clientWidth);
}

function axis() {
  const line = { stroke: () => colour("--line"), width: 1 };
  return { stroke: () => colour("--ink"), grid: line, ticks: line, font: "12px system-ui" };
}

function lineOf(one, index) {
  return {
    label: one.label,
    stroke: () => colour(one.colour),
    width: one.width || 1.5,
    dash: DASHES[one.number === undefined ? index % DASHES.length : one.number],
    paths: one.stepped ? uPlot.paths.stepped({ align: 1 }) : undefined,
    points: { show: Boolean(one.points), size: 5, fill: () => colour(one.colour) },
    isMean: Boolean(one.points),
    value: (plot, value) => (value === null || value === undefined ? "–" : value.toPrecision(4)),
  };
}

// A sample is a mean over the time before it: a bar shows over which.
function drawWindows(plot, windowMs) {
  if (!windowMs) return;
  const { ctx, data, series } = plot;
  ctx.save();
  clip(plot);
  ctx.globalAlpha = 0.55;
  ctx.lineWidth = 2 * uPlot.pxRatio;
  for (let number = 1; number < series.length; number += 1) {
    if (!series[number].isMean || !series[number].show) continue;
    ctx.strokeStyle = series[number].stroke(plot, number);
    ctx.beginPath();
    data[0].forEach((x, row) => {
      const y = data[number][row];
      if (y === null) return;
      const height = plot.valToPos(y, "y", true);
      ctx.moveTo(plot.valToPos(x - windowMs, "x", true), height);
      ctx.lineTo(plot.valToPos(x, "x", true), height);
    });
    ctx.stroke();
  }
  ctx.restore();
}

function shadeGaps(plot, gaps) {
  plot.ctx.save();
  clip(plot);
  plot.ctx.fillStyle = colour("--grey");
  plot.ctx.globalAlpha = 0.25;
  for (const [from, to] of gaps) {
    const left = plot.valToPos(from, "x", true);
    plot.ctx.fillRect(left, plot.bbox.top, plot.valToPos(to, "x", true) - left, plot.bbox.height);
  }
  plot.ctx.restore();
}

function drawMarks(plot, marks) {
  plot.ctx.save();
  clip(plot);
  plot.ctx.lineWidth = 2 * uPlot.pxRatio;
  for (const mark of marks) {
    const left = plot.valToPos(mark.at, "x", true);
    plot.ctx.strokeStyle = colour(mark.colour);
    plot.ctx.setLineDash(mark.dashed ? [6, 4] : []);
    plot.ctx.beginPath();
    plot.ctx.moveTo(left, plot.bbox.top);
    plot.ctx.lineTo(left, plot.bbox.top + plot.bbox.height);
    plot.ctx.stroke();
  }
  plot.ctx.restore();
}

function clip(plot) {
  plot.ctx.beginPath();
  plot.ctx.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
  plot.ctx.clip();
}

function removeCharts(parent) {
  for (const chart of charts.filter((one) => one.parent === parent)) {
    chart.plot.destroy();
    charts.splice(charts.indexOf(chart), 1);
  }
  parent.replaceChildren();
}

function fitCharts() {
  for (const { plot, box } of charts) plot.setSize({ width: widthOf(box), height: plot.height });
}

// Setpoints come twice a second at least while somebody sends any; those by attitude with each IMU sample.
const PLACE_HELD_S = 1.0;
const ATTITUDE_HELD_S = 0.3;

// The charts of the whole flight. A line is a column of a table; of another table than the first line's it is the last
// row, if no older than `held`. What passes `top` leaves the picture; `level` is a line across it.
const OVERVIEWS = [
  { title: "Speed and height", unit: "m/s, m", lines: [
    { table: "path", column: "speed", label: "speed, m/s", colour: "blue" },
    { table: "path", column: "height", label: "height, m", colour: "orange", dashed: true },
  ] },
  { title: "Place and setpoint", unit: "m", lines: [
    { table: "path", column: "n", label: "north", colour: "blue" },
    { table: "setpoint", column: "n", label: "its setpoint", colour: "blue", dashed: true, held: PLACE_HELD_S },
    { table: "path", column: "e", label: "east", colour: "orange" },
    { table: "setpoint", column: "e", label: "its setpoint", colour: "orange", dashed: true, held: PLACE_HELD_S },
  ] },
  { title: "Lean", unit: "°", lines: [
    { table: "attitude", column: "roll", label: "roll, right side down", colour: "blue" },
    { table: "attitude", column: "pitch", label: "pitch, nose up", colour: "orange", dashed: true },
  ] },
  { title: "Tilt, wanted and flown; green: hand-over", unit: "°", lines: [
    { table: "attitude", column: "tilt", label: "flown", colour: "blue" },
    { table: "wanted", column: "tilt", label: "wanted by the companion", colour: "red", held: ATTITUDE_HELD_S },
    { table: "target", column: "tilt", label: "wanted by the vehicle's own control", colour: "orange", dashed: true, held: ATTITUDE_HELD_S },
  ] },
  { title: "Thrust, wanted and flown; green: hand-over", unit: "share of the most", lines: [
    { table: "target", column: "thrust", label: "flown by the vehicle's own control", colour: "blue" },
    { table: "wanted", column: "thrust", label: "wanted by the companion", colour: "red", held: ATTITUDE_HELD_S },
  ] },
  // What a contact makes leaves the picture: what came near to one is looked for.
  { title: "How near to a hit, while the detector was on", unit: "thresholds", top: 1.5, level: [1, "a hit from here on"], lines: [
    { table: "imu", column: "ratio", label: "push or turn over its threshold", colour: "blue" },
    { table: "jump", column: "ratio", label: "velocity jump over its threshold", colour: "orange", held: flight.jump_held_s },
  ] },
  { title: "Specific force sideways", unit: "m/s²", lines: [
    { table: "force", column: "peak", label: "largest in a tenth of a second", colour: "blue" },
  ] },
];

// What there is to be seen of them, each with a function that gives its columns.
function overviews() {
  const isThere = ({ table, column }) => tables[table] && tables[table].has(column) && (tables[table].length || flight.live);
  return OVERVIEWS.map((one) => ({ ...one, lines: one.lines.filter(isThere) })).filter((one) => one.lines.length).map((one) => {
    const series = one.lines.map((line) => ({ label: line.label, colour: `--${line.colour}`, number: line.dashed ? 1 : 0 }));
    if (one.level) series.push({ label: one.level[1], colour: "--red", number: 1 });
    const columns = () => {
      const first = tables[one.lines[0].table];
      const { t } = first.columns;
      const found = one.lines.map(({ table, column, held }) =>
        tables[table] === first ? first.columns[column] : Array.from(t, (time) => lastAt(tables[table], column, time, held)));
      return [t, ...found, ...(one.level ? [Array.from(t, () => one.level[0])] : [])].map(plotted);
    };
    return { title: one.title, unit: one.unit, series, columns, up: one.top === undefined ? {} : { range: [0, one.top] } };
  });
}

// What the last row before a time says; none where it is older than that.
function lastAt(table, column, time, held) {
  const { t } = table.columns;
  const row = rowAt(t, time);
  return row >= 0 && time - t[row] < held ? table.columns[column][row] : NaN;
}

// Moments, and when a recovery by attitude went over to a position.
function overviewMarks() {
  const marks = flight.moments.map((moment) => ({ at: moment.t, colour: "--red", dashed: moment.kind !== "hit" }));
  const handed = flight.events.filter((event) => event.kind === "hand_over");
  return [...marks, ...handed.map((event) => ({ at: event.t, colour: "--green" }))];
}

// A click goes to its time. `showNow` marks a time, `refill` takes what a live flight has brought.
function addOverview(parent, goTo) {
  const marks = overviewMarks();
  const range = flight.live ? undefined : [0, Math.max(flight.duration_s, 0.001)];
  const made = overviews().map((one) => {
    const [x, ...values] = one.columns();
    const series = one.series.map((line, number) => ({ ...line, values: values[number] }));
    const chart = addChart(parent, { ...one, across: "s", x, series, marks, range });
    const now = element("div", undefined, "now");
    chart.plot.over.append(now);
    chart.plot.over.addEventListener("click", () => goTo(chart.plot.posToVal(chart.plot.cursor.left, "x")));
    return { plot: chart.plot, now, columns: one.columns };
  });
  return {
    showNow: (time) => made.forEach(({ plot, now }) => { now.style.left = `${plot.valToPos(time, "x")}px`; }),
    refill: () => {
      marks.splice(0, marks.length, ...overviewMarks());
      made.forEach(({ plot, columns }) => plot.setData(columns()));
    },
  };
}

// Rows of a table within the microscope, in milliseconds of the vehicle's clock from the moment; lost ones as null.
function near(table, moment, names, lostFrom = 1.5) {
  const { t, boot } = table.columns;
  // By the log's clock first: a vehicle's own begins anew when it reboots.
  const rows = [];
  for (let row = Math.max(0, rowAt(t, moment.t - 3)); row < table.length && t[row] < moment.t + 3; row += 1) {
    if (Math.abs((boot[row] - moment.boot) * 1e3) <= MICROSCOPE_MS) rows.push(row);
  }
  const usual = usualInterval(rows.map((row) => boot[row]));
  const found = { x: [], gaps: [], columns: names.map(() => []) };
  rows.forEach((row, index) => {
    const x = (boot[row] - moment.boot) * 1e3;
    const before = index ? (boot[rows[index - 1]] - moment.boot) * 1e3 : x;
    if (x - before > 1e3 * lostFrom * usual) {
      found.gaps.push([before, x]);
      found.x.push((before + x) / 2);
      found.columns.forEach((column) => column.push(null));
    }
    found.x.push(x);
    names.forEach((name, number) => {
      const value = table.columns[name][row];
      found.columns[number].push(Number.isFinite(value) ? value : null);
    });
  });
  return found;
}

function usualInterval(times) {
  const intervals = times.slice(1).map((time, index) => time - times[index]).sort((a, b) => a - b);
  return intervals.length ? intervals[intervals.length >> 1] : Infinity;
}

const AXES = ["--blue", "--orange", "--green"];

function addMicroscope(parent, moment) {
  removeCharts(parent);
  const marks = [{ at: 0, colour: "--red" }];
  if (moment.touched_ms !== null) marks.push({ at: moment.touched_ms, colour: "--purple", dashed: true });
  const shared = { across: "ms", marks, range: [-MICROSCOPE_MS, MICROSCOPE_MS] };
  const windowMs = flight.averaging_ms;
  const imu = near(tables.imu, moment, ["fx", "fy", "fz", "p", "q", "r", "side", "side_threshold", "beyond", "beyond_threshold"]);
  const means = (labels, first) =>
    labels.map((label, number) => ({ label, values: imu.columns[first + number], colour: AXES[number], points: true }));
  const body = ["x, forward", "y, right", "z, down"];
  const plain = { ...shared, x: imu.x, gaps: imu.gaps, windowMs };
  if (imu.x.length) {
    addChart(parent, { ...plain, title: "Specific force, body", unit: "m/s²", series: means(body, 0) });
    addChart(parent, { ...plain, title: "Angular rate, body", unit: "rad/s", series: means(body, 3) });
  }
  addVelocity(parent, moment, shared);
  if (imu.x.length) {
    const series = [
      { label: "push sideways", values: imu.columns[6], colour: "--blue", points: true },
      { label: "its threshold", values: imu.columns[7], colour: "--blue", number: 1, stepped: true },
      { label: "beyond the thrust", values: imu.columns[8].map((push) => (push > QUIETEST ? push : null)), colour: "--orange", points: true },
      { label: "its threshold", values: imu.columns[9], colour: "--orange", number: 1, stepped: true },
    ];
    addChart(parent, { ...plain, title: "The test and its thresholds", unit: "m/s²", series, up: POWERS });
  }
  addFolds(parent, moment, shared);
}

function addVelocity(parent, moment, shared) {
  const measured = near(tables.path, moment, ["vn", "ve", "vd"], 2.5); // a slow stream comes in whole ticks of the vehicle
  if (!measured.x.length) return;
  const names = ["north", "east", "down"];
  const lines = names.map((label, number) => ({ label, values: measured.columns[number], colour: AXES[number], points: true }));
  addChart(parent, { ...shared, x: measured.x, gaps: measured.gaps, title: "Velocity, as the vehicle says", unit: "m/s", series: lines });
  if (!tables.truth) return;
  const truth = near(tables.truth, moment, ["vn", "ve", "vd"]);
  const series = names.map((label, number) => ({ label, values: truth.columns[number], colour: AXES[number] }));
  if (truth.x.length) addChart(parent, { ...shared, x: truth.x, title: "Velocity, as the simulator knows", unit: "m/s", series });
}

function addFolds(parent, moment, shared) {
  if (!tables.truth) return;
  const truth = near(tables.truth, moment, FOLDS);
  const colours = ["--blue", "--purple", "--sky", "--orange", "--green", "--red", "--stone", "--grey"];
  const series = flight.vehicle.arms.map(([ahead, aside], number) => {
    const along = Math.abs(ahead) < 0.01 ? "" : ahead > 0 ? "front " : "rear ";
    const label = `${number + 1}, ${along}${aside > 0 ? "right" : "left"}`;
    return { label, values: truth.columns[number].map((fold) => 1e3 * fold), colour: colours[number] };
  });
  if (truth.x.length) addChart(parent, { ...shared, x: truth.x, title: "Fold of each arm, as the simulator knows", unit: "mm", series });
}

// How much later than the quickest of all each sample arrived.
function addLink(parent) {
  const { t, boot } = tables.imu.columns;
  if (!tables.imu.length) return;
  let least = Infinity;
  for (let row = 0; row < t.length; row += 1) least = Math.min(least, t[row] - boot[row]);
  const late = Array.from(t, (time, row) => 1e3 * (time - boot[row] - least));
  const series = [{ label: "later by", values: plotted(late), colour: "--blue" }];
  // Room below: a link without any lateness is a line, and no part of the axis.
  const up = { range: (plot, low, high) => [-0.1, 1.1].map((share) => share * Math.max(1, high)) };
  addChart(parent, { title: "IMU samples: later than the quickest", unit: "ms", across: "s", x: plotted(t), series, height: 140, up });
}
