// Over all scenarios: the map of one measure, the performance profile, the scorecard.
function drawOverview() {
  const column = REPORT.columns.find((one) => one.key === byId("map-measure").value);
  const solver = byId("map-solver").value, start = byId("map-start").value;
  const place = REPORT.columns.indexOf(column), scenarios = REPORT.scenarios.map((one) => one.name);
  const of = (formulation, scenario) => {
    const cell = cellOf(scenario, formulation, solver, start);
    return cell && cell.values ? cell.values[place] : null;
  };
  const rows = REPORT.formulations.filter((formulation) => scenarios.some((name) => of(formulation, name) !== null));
  const raw = rows.map((formulation) => scenarios.map((name) => of(formulation, name)));
  const flat = raw.flat().filter((value) => typeof value === "number");
  const wide = flat.length && Math.min(...flat) > 0 && Math.max(...flat) / Math.min(...flat) > 30;
  const z = raw.map((line) => line.map((v) => (typeof v === "boolean" ? Number(v) : typeof v !== "number" ? null : wide ? Math.log10(v) : v)));
  const heat = colour("--heat");
  draw("plot-map", rows.length ? [{
    type: "heatmap", x: scenarios, y: rows, z, text: raw.map((line) => line.map((v) => (v === null ? "" : number(v, column.format)))),
    texttemplate: "%{text}", hovertemplate: "%{y}<br>%{x}<br><b>%{text}</b> " + column.unit + "<extra></extra>", xgap: 2, ygap: 2,
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
  const clock = byId("profile-clock").value;
  const profile = REPORT.profiles[clock] || { curves: [] };
  const traces = profile.curves.map((curve) => {
    const style = REPORT.styles.solvers[curve.solver] || [colour("--ink"), "solid"];
    return {
      x: curve.ratio, y: curve.share, name: curve.name, mode: "lines", line: { color: style[0], dash: style[1], width: 2, shape: "hv" },
      hovertemplate: "within %{x:.3~g} x the fastest in %{y:.0%}<extra>" + escapeText(curve.name) + "</extra>",
    };
  });
  draw("plot-profile", traces, layout(400, {
    showlegend: true, xaxis: axis("time over that of the fastest, logarithmic", { type: "log", dtick: "D2" }),
    yaxis: axis("share of problems", { tickformat: ".0%", range: [0, 1.02] }), empty: "No cell has this clock.",
  }));
  byId("profile-note").textContent = profile.note || "";
}
