"use strict";
// The page's state: what is selected, and the curves that were unpacked so far.
const REPORT = JSON.parse(document.getElementById("report-data").textContent);
const byId = (id) => document.getElementById(id);
const element = (tag, text, attributes = {}) => {
  const made = document.createElement(tag);
  if (text !== null && text !== undefined) made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};
const cellsByKey = new Map(
  REPORT.cells.map((cell) => [[cell.scenario, cell.formulation, cell.solver, cell.start].join("\n"), cell]));
const cellOf = (scenario, formulation, solver, start) =>
  cellsByKey.get([scenario, formulation, solver, start].join("\n"));

// A baseline has neither solver nor start: whichever of them is selected, it has the same cell.
const NONE = "-";
const isBaseline = (formulation) => REPORT.baselines.includes(formulation);
const controllerOf = (scenario, formulation, solver, start) =>
  isBaseline(formulation) ? cellOf(scenario, formulation, NONE, NONE) : cellOf(scenario, formulation, solver, start);

const state = {
  scenario: REPORT.scenarios[0].name, by: "solvers", formulation: REPORT.formulations[0], solver: REPORT.solvers[0],
  start: REPORT.starts[0], clock: REPORT.clocks[0].name, shown: { solvers: null, formulations: null },
};
const STORED = ["scenario", "by", "formulation", "solver", "start", "clock"];

function readHash() {
  const given = new URLSearchParams(location.hash.slice(1));
  const known = {
    scenario: REPORT.scenarios.map((s) => s.name), by: ["solvers", "formulations"], formulation: REPORT.formulations,
    solver: REPORT.solvers, start: REPORT.starts, clock: REPORT.clocks.map((c) => c.name),
  };
  for (const name of STORED) if (known[name].includes(given.get(name))) state[name] = given.get(name);
}
function writeHash() {
  const hash = new URLSearchParams(STORED.map((name) => [name, state[name]]));
  history.replaceState(null, "", "#" + hash);
}

const unpacked = new Map();
// Curves lie in the page as gzip in base64, one script element to a cell: only what is looked at is unpacked.
function curvesOf(cell) {
  if (!unpacked.has(cell.id)) {
    const holder = byId("curves-" + cell.id);
    unpacked.set(cell.id, holder ? inflate(holder.textContent.trim()) : Promise.resolve({}));
  }
  return unpacked.get(cell.id);
}
async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const number = (value, format) => {
  if (value === null || value === undefined) return "\u2013";
  if (typeof value === "string") return value;
  if (typeof value === "boolean") return value ? "yes" : "no";
  switch (format) {
    case "int": return Math.round(value).toLocaleString("en");
    case "us": return significant(1e6 * value, 3);
    case "percent": return significant(100 * value, 3);
    default: return significant(value, 3);
  }
};
function significant(value, digits) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
  if (size >= 1000) return Math.round(value).toLocaleString("en");
  return String(Number(value.toPrecision(digits)));
}
