// Over all scenarios: the map of one measure, the performance profile, the scorecard.
function drawOverview() {
  const column = REPORT.columns.find((one) => one.key === byId("map-measure").value);
  const solver = byId("map-solver").value, start = byId("map-start").value;
  const scenarios = REPORT.scenarios.map((one) => one.name);
  const of = (formulation, scenario) => {
    const cell = controllerOf(scenario, formulation, solver, start);
    return cell && cell.values ? cell.values[column.at] : null;
  };
  const rows = REPORT.formulations.filter((formulation) => scenarios.some((name) => of(formulation, name) !== null));
  const raw = rows.map((formulation) => scenarios.map((name) => of(formulation, name)));
  const flat = raw.flat().filter((value) => typeof value === "number");
  const wide = flat.length && Math.min(...flat) > 0 && Math.max(...flat) / Math.min(...flat) > 30;
  const z = raw.map((line) => line.map((v) => (typeof v === "boolean" ? Number(v) : typeof v !== "number" ? null : wide ? Math.log10(v) : v)));
  const heat = colour("--heat");
  draw("plot-map", rows.length ? [{
    type: "heatmap", x: scenarios, y: rows, z, text: raw.map((line) => line.map((v) => (v === null ? "" : number(v, column.format)))),
    texttemplate: "%{text}", textfont: { color: colour("--ink") }, hovertemplate: "%{y}<br>%{x}<br><b>%{text}</b> " + column.unit + "<extra></extra>", xgap: 2, ygap: 2,
    colorscale: [[0, `rgba(${heat}, .05)`], [1, `rgba(${heat}, .62)`]], showscale: false, hoverongaps: false,
  }] : [], layout(120 + 34 * rows.length, {
    xaxis: axis("", { side: "top", tickangle: -30, showgrid: false }), yaxis: axis("", { autorange: "reversed", showgrid: false }),
    margin: { l: 150, r: 12, t: 90, b: 12 }, empty: "No cell of this solver and start has this measure.",
  }));
  byId("map-help").textContent = column.help;
  const holder = byId("plot-map");
  if (rows.length && !holder.dataset.linked) {
    holder.dataset.linked = "yes";
    holder.on("plotly_click", (event) => {
      const point = event.points[0];
      select({ scenario: point.x, formulation: point.y, solver: byId("map-solver").value, by: "solvers" }, true);
    });
  }
}

function drawProfile() {
  const name = byId("profile-clock").value + "_" + byId("profile-of").value;
  const profile = REPORT.profiles[name] || { curves: [], means: [], problems: 0, baseline: "" };
  const dashes = { cold: "solid", "active-set": "dash", solution: "dot" };
  const look = (curve) => ({ color: REPORT.styles.solvers[curve.solver][0], dash: dashes[curve.start], width: 2, shape: "hv" });
  const end = Math.max(2, ...profile.curves.flatMap((curve) => curve.ratio)) * 1.3;
  draw("plot-profile", profile.curves.map((curve) => ({
    x: [...curve.ratio, end], y: [...curve.share, curve.share[curve.share.length - 1]], name: curve.name, mode: "lines", line: look(curve),
    hovertemplate: "within %{x:.3~g} x the fastest in %{y:.0%}<extra>" + escapeText(curve.name) + "</extra>",
  })), layout(430, {
    showlegend: true, xaxis: axis("time over that of the fastest, logarithmic", { type: "log", range: [0, Math.log10(end)], dtick: end > 50 ? 1 : "D2" }),
    yaxis: axis("share of problems", { tickformat: ".0%", range: [0, 1.02] }), empty: "No cell has this clock.",
  }));
  byId("profile-note").textContent = profile.problems ? `${profile.problems} problems (scenario x formulation); dashed: warm starts.` : "";
  const means = profile.means.filter((one) => one.ratio !== null).reverse();
  const solverOf = (mean) => profile.curves.find((curve) => curve.name === mean.name).solver;
  draw("plot-means", means.length ? [{
    x: means.map((one) => one.ratio), y: means.map((one) => one.name), type: "scatter", mode: "markers",
    marker: { size: 9, color: means.map((one) => REPORT.styles.solvers[solverOf(one)][0]) },
    error_x: {
      type: "data", symmetric: false, array: means.map((one) => one.high - one.ratio), arrayminus: means.map((one) => one.ratio - one.low),
      color: colour("--muted"), thickness: 1.2, width: 4,
    },
    customdata: means.map((one) => [one.low, one.high, one.problems, one.left_out]),
    hovertemplate: "%{x:.3g} times (%{customdata[0]:.3g} to %{customdata[1]:.3g})<br>%{customdata[2]} problems, %{customdata[3]} left out" +
      "<extra>%{y}</extra>",
  }] : [], layout(90 + 24 * means.length, {
    xaxis: axis("times as long, logarithmic", { type: "log", dtick: "D2" }), yaxis: axis("", { automargin: true }), margin: { l: 150, r: 18, t: 10, b: 44 },
    shapes: [{ type: "line", x0: 1, x1: 1, y0: 0, y1: 1, yref: "paper", line: { color: colour("--muted"), width: 1, dash: "dash" } }],
    empty: "No cell has this clock.",
  }));
  for (const text of document.querySelectorAll(".baseline")) text.textContent = profile.baseline || "the first solver";
}

function filterScore() {
  const table = byId("score-table");
  if (!table) return;
  for (const row of table.tBodies[0].rows) {
    // What solver and start are chosen is nothing to a baseline.
    row.hidden = row.dataset.solver !== NONE && [["solver", "score-solver"], ["start", "score-start"]].some(
      ([key, id]) => byId(id).value && row.dataset[key] !== byId(id).value);
  }
}
