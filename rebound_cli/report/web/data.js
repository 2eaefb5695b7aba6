// The flight's data, decoded once: tables of columns, each a Float64Array with NaN for "none".
"use strict";

const flight = JSON.parse(document.getElementById("flight").textContent);

const NONE = { i2: -32768, i4: -2147483648 };
const ARRAYS = { i2: Int16Array, i4: Int32Array };

// Unit of each column, for charts and files.
const UNITS = {
  t: "s", boot: "s", fx: "m/s2", fy: "m/s2", fz: "m/s2", p: "rad/s", q: "rad/s", r: "rad/s", phase: "",
  side: "m/s2", side_threshold: "m/s2", beyond: "m/s2", beyond_threshold: "m/s2",
  n: "m", e: "m", d: "m", vn: "m/s", ve: "m/s", vd: "m/s", qw: "", qx: "", qy: "", qz: "", roll: "deg", pitch: "deg", tilt: "deg", thrust: "", ratio: "",
  speed: "m/s", height: "m",
};

function decoded(column) {
  const bytes = Uint8Array.from(atob(column.data), (letter) => letter.charCodeAt(0));
  // Little-endian, as every processor that shows pages is.
  const whole = new ARRAYS[column.kind](bytes.buffer);
  // A live table grows.
  return (flight.live ? Array : Float64Array).from(whole, (step) => (step === NONE[column.kind] ? NaN : (step + column.offset) * column.resolution));
}

function tableOf(packed) {
  const columns = {};
  for (const name of Object.keys(packed.columns)) columns[name] = decoded(packed.columns[name]);
  return { get length() { return columns.t.length; }, of: packed.of, columns, has: (name) => name in columns };
}

const tables = {};
for (const name of Object.keys(flight.tables)) tables[name] = tableOf(flight.tables[name]);
const FOLDS = flight.vehicle.arms.map((_, number) => `fold${number + 1}`);
for (const name of FOLDS) UNITS[name] = "m";

// The last row that is no later than the value; -1 before the first.
function rowAt(sorted, value) {
  let low = 0;
  let high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// The columns of these names at a time, straight between the rows; null where the table is empty.
function at(table, names, time) {
  if (!table || !table.length || !table.has(names[0])) return null;
  const times = table.columns.t;
  const row = Math.max(0, rowAt(times, time));
  const next = Math.min(row + 1, table.length - 1);
  const span = times[next] - times[row];
  const share = span > 0 ? Math.min(1, Math.max(0, (time - times[row]) / span)) : 0;
  return names.map((name) => {
    const values = table.columns[name];
    return values[row] + share * (values[next] - values[row]);
  });
}

// The flight mode at a time, and its number among the modes of this flight.
const modeNames = [...new Set(flight.modes.map((mode) => mode[1]))];

function modeAt(time) {
  let name = "";
  for (const [since, mode] of flight.modes) if (since <= time) name = mode;
  return name;
}

function isRecovering(time) {
  return flight.recovering.some(([from, to]) => from <= time && time < to);
}

const MODE_COLOURS = ["--grey", "--blue", "--green", "--sky", "--orange", "--stone"];

function colour(variable) {
  return getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
}

// A recovery stands out from whatever mode it is flown in.
function pathColour(time) {
  if (isRecovering(time)) return "--red";
  const number = modeNames.indexOf(modeAt(time));
  return MODE_COLOURS[(number + 1) % MODE_COLOURS.length];
}

// Text from anywhere is shown as text, whatever is in it.
function element(tag, text, className) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}
