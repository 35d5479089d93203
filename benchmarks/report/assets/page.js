// Ties it together: controls, theme, first drawing.
function options(select, values, chosen) {
  select.replaceChildren(...values.map((value) => {
    const [name, text] = Array.isArray(value) ? value : [value, value];
    const made = element("option", text, { value: name });
    made.selected = name === chosen;
    return made;
  }));
}
function fillControls() {
  options(byId("scenario"), REPORT.scenarios.map((one) => one.name), state.scenario);
  options(byId("by"), [["solvers", "solvers of one formulation"], ["formulations", "formulations with one solver"]], state.by);
  options(byId("formulation"), REPORT.formulations, state.formulation);
  options(byId("solver"), REPORT.solvers, state.solver);
  options(byId("start"), REPORT.starts.map((name) => [name, REPORT.start_names[name] || name]), state.start);
  options(byId("clock"), REPORT.clocks.map((one) => [one.name, one.text]), state.clock);
  byId("formulation").parentElement.hidden = state.by !== "solvers";
  byId("solver").parentElement.hidden = state.by !== "formulations";
  const scenario = REPORT.scenarios.find((one) => one.name === state.scenario);
  byId("scenario-text").textContent = `${scenario.description} (${scenario.facts})`;
  fillChips();
}
function has(name) {
  if (state.by === "formulations" && isBaseline(name)) return Boolean(cellOf(state.scenario, name, NONE, NONE));
  return REPORT.starts.some((start) => (state.by === "solvers" ? cellOf(state.scenario, state.formulation, name, start)
    : cellOf(state.scenario, name, state.solver, start)));
}
function fillChips() {
  byId("chips").replaceChildren(...REPORT[state.by].map((name) => {
    const [line, dash] = REPORT.styles[state.by][name], on = state.shown[state.by].has(name);
    const chip = element("button", null, { type: "button", class: "chip", "aria-pressed": String(on) });
    const sample = element("i");
    sample.style.borderTopColor = line;
    sample.style.borderTopStyle = { solid: "solid", dash: "dashed", dot: "dotted" }[dash];
    chip.append(sample, document.createTextNode(name));
    chip.disabled = !has(name);
    chip.addEventListener("click", () => {
      if (on) state.shown[state.by].delete(name); else state.shown[state.by].add(name);
      fillChips();
      drawScenario();
    });
    return chip;
  }));
}
const measureName = (one) => {
  const group = one.group === "main" ? "" : one.group.replace("time: ", "") + ": ";
  return group + one.label + (one.unit ? ` [${one.unit}]` : "");
};
function showFirst(names, wanted) {
  const ordered = [...names.filter((name) => name === wanted), ...names.filter((name) => name !== wanted)];
  return new Set(ordered.slice(0, 4));
}
function select(changes, scroll = false) {
  Object.assign(state, changes);
  const wanted = { solvers: state.solver, formulations: state.formulation };
  state.shown[state.by].add(wanted[state.by]);
  fillControls();
  writeHash();
  drawScenario();
  if (scroll) byId("figures").scrollIntoView();
}
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  byId("theme").textContent = name === "dark" ? "Light" : "Dark";
  try { localStorage.setItem("kinqp-theme", name); } catch { /* a page from a file may have no storage */ }
}
function drawAll() {
  drawOverview();
  drawProfile();
  drawScenario();
}
function start() {
  let kept = null;
  try { kept = localStorage.getItem("kinqp-theme"); } catch { /* as above */ }
  setTheme(kept || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
  readHash();
  state.shown.solvers = showFirst(REPORT.solvers, state.solver);
  state.shown.formulations = showFirst(REPORT.formulations, state.formulation);
  fillControls();
  for (const name of STORED) byId(name).addEventListener("change", (event) => select({ [name]: event.target.value }));
  options(byId("map-measure"), ONCE.map((one) => [one.key, measureName(one)]), REPORT.first_measure);
  options(byId("map-solver"), REPORT.solvers, state.solver);
  options(byId("map-start"), REPORT.starts, state.start);
  for (const id of ["map-measure", "map-solver", "map-start"]) byId(id).addEventListener("change", drawOverview);
  options(byId("profile-clock"), REPORT.clocks.map((one) => [one.name, one.text]), state.clock);
  for (const id of ["profile-clock", "profile-of"]) byId(id).addEventListener("change", drawProfile);
  const every = (values) => [["", "all"], ...values.map((value) => [value, value])];
  if (byId("score-table")) {
    options(byId("score-solver"), every(REPORT.solvers), REPORT.solvers[0]);
    options(byId("score-start"), every(REPORT.starts), REPORT.starts[0]);
    for (const id of ["score-solver", "score-start"]) byId(id).addEventListener("change", filterScore);
    filterScore();
  }
  options(byId("only-scenario"), every(REPORT.scenarios.map((one) => one.name)), "");
  options(byId("only-formulation"), every(REPORT.formulations), "");
  const none = REPORT.baselines.length ? [NONE] : [];
  options(byId("only-solver"), every([...REPORT.solvers, ...none]), "");
  options(byId("only-start"), every([...REPORT.starts, ...none]), "");
  options(byId("only-state"), every([...new Set(REPORT.cells.map((cell) => cell.state))]), "");
  options(byId("group"), [...new Set(REPORT.columns.map((column) => column.group)), "all"], REPORT.columns[0] && REPORT.columns[0].group);
  for (const key of FIXED.map(([name]) => name)) byId("only-" + key).addEventListener("change", refreshTable);
  byId("filter").addEventListener("input", refreshTable);
  byId("group").addEventListener("change", fillTable);
  byId("more").addEventListener("click", () => { table.limit = Infinity; fillTable(); });
  byId("csv").addEventListener("click", saveCsv);
  byId("cells-table").tBodies[0].addEventListener("click", (event) => {
    const row = event.target.closest("tr");
    if (!row) return;
    const cell = REPORT.cells.find((one) => one.id === Number(row.dataset.cell));
    const own = cell.solver === NONE ? {} : { solver: cell.solver, start: cell.start };
    select({ scenario: cell.scenario, formulation: cell.formulation, ...own, by: "solvers" }, true);
  });
  byId("theme").addEventListener("click", () => {
    setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    drawAll();
  });
  refreshTable();
  drawAll();
}
start();
