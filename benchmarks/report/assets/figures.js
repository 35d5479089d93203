// Figures of the selected scenario. All take their colours from the page, so that dark and light both work.
const CONFIG = {
  responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
  toImageButtonOptions: { format: "svg" },
};
const axis = (title, more = {}) => ({
  title: { text: title, standoff: 6, font: { size: 12 } }, gridcolor: colour("--line"), zerolinecolor: colour("--line"),
  linecolor: colour("--line"), automargin: true, ...more,
});
const layout = (height, more = {}) => ({
  height, margin: { l: 64, r: 18, t: 14, b: 44 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
  font: { family: getComputedStyle(document.body).fontFamily, size: 12.5, color: colour("--ink") },
  hoverlabel: { font: { size: 12.5 } },
  modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("--line"), activecolor: colour("--muted") }, showlegend: false, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
  ...more,
});
const suffix = (index) => (index ? String(index + 1) : "");

function draw(id, traces, made) {
  const holder = byId(id);
  if (!traces.length) {
    if (holder.classList.contains("js-plotly-plot")) Plotly.purge(holder);
    holder.style.height = "";
    holder.replaceChildren(element("div", made.empty || "Nothing recorded for this selection.", { class: "empty" }));
    return;
  }
  if (!holder.classList.contains("js-plotly-plot")) holder.replaceChildren();
  holder.style.height = made.height + "px";
  Plotly.react(holder, traces, made, CONFIG);
}

// One panel per series on one scale: zigzags drawn over each other can't be told apart.
function panels(id, series, options) {
  const count = Math.max(series.length, 1), height = 112 * count - 26, gap = 26 / height, size = 86 / height;
  const made = layout(height + 26 + 44, { xaxis: axis(options.x, { anchor: "y" + suffix(count - 1) }), annotations: [] });
  const traces = series.map((one, index) => {
    const top = 1 - index * (size + gap);
    made["yaxis" + suffix(index)] = axis(index === Math.floor((count - 1) / 2) ? options.y : "", {
      domain: [Math.max(0, top - size), top], type: options.log ? "log" : "linear", nticks: 4,
      ...(index ? { matches: "y" } : {}), ...(options.log ? { dtick: 1 } : { rangemode: "tozero" }),
    });
    made.annotations.push({
      text: `<b>${escapeText(one.name)}</b>`, x: 0.004, xref: "paper", xanchor: "left", y: top, yref: "paper", yanchor: "bottom",
      showarrow: false, font: { size: 12, color: one.colour },
    });
    return {
      x: one.x, y: one.y, name: one.name, xaxis: "x", yaxis: "y" + suffix(index), mode: options.points ? "markers" : "lines",
      line: { color: one.colour, width: 1.2 }, marker: { color: one.colour, size: 4, opacity: 0.8 },
      hovertemplate: `%{y:.4~g} ${options.unit}<br>${options.still ? "state %{x}" : "%{x:.3f} s"}<extra>${escapeText(one.name)}</extra>`,
    };
  });
  made.shapes = options.marks || [];
  made.margin.t = 26;
  draw(id, traces, { ...made, empty: options.empty });
}
const escapeText = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");

// What is compared now: [{name, cell, curves, colour, dash}], of cells that are shown and hold something.
async function chosen() {
  const names = REPORT[state.by];
  const alone = state.by === "solvers" && isBaseline(state.formulation);
  const wanted = alone ? [NONE] : names.filter((name) => state.shown[state.by].has(name));
  const found = [];
  for (const name of wanted) {
    const cell = state.by === "solvers" ? controllerOf(state.scenario, state.formulation, name, startFor(state.formulation, name))
      : controllerOf(state.scenario, name, state.solver, startFor(name, state.solver));
    if (!cell) continue;
    const style = alone ? REPORT.styles.formulations[state.formulation] : REPORT.styles[state.by][name];
    const label = cell.solver === NONE ? cell.formulation : cell.start === state.start ? name : `${name} (${cell.start})`;
    found.push({ name: label, cell, curves: await curvesOf(cell), colour: style[0], dash: style[1] });
  }
  return found;
}
// A solver that can't start warm is shown by the start it has.
function startFor(formulation, solver) {
  if (cellOf(state.scenario, formulation, solver, state.start)) return state.start;
  return REPORT.starts.find((start) => cellOf(state.scenario, formulation, solver, start)) || state.start;
}

// Runs that coincide are seen nonetheless: the first lies widest, the last narrowest on top.
const nested = (place, count) => 1.4 + 1.5 * (count - 1 - place);

let drawing = 0;
async function drawScenario() {
  const turn = ++drawing;
  const scenario = REPORT.scenarios.find((one) => one.name === state.scenario);
  const all = await chosen();
  if (turn !== drawing) return;
  const dt = scenario.dt, still = scenario.independent;
  const x = (curve) => (still ? curve.i : curve.i.map((i) => i * dt));
  const xTitle = still ? "state" : "time [s]";
  const marks = scenario.switches.map((t) => ({
    type: "line", x0: t, x1: t, xref: "x", y0: 0, y1: 1, yref: "paper", line: { color: colour("--muted"), width: 1, dash: "dot" },
  }));
  const series = (pick) => all.filter((one) => pick(one.curves)).map((one) => {
    const curve = pick(one.curves);
    return { ...one, x: x(curve), y: curve.y };
  });
  const clock = REPORT.clocks.find((one) => one.name === state.clock);
  const noClock = `None of the cells shown has this clock (${clock.text}). Choose another one above.`;
  panels("plot-iterations", series((c) => c.iterations), { x: xTitle, y: "iterations", unit: "iterations", marks, still, points: still });
  const timed = { x: xTitle, y: "time [\u00b5s]", unit: "\u00b5s", marks, still, points: true, empty: noClock };
  panels("plot-times", series((c) => c[state.clock] && c[state.clock].all), { ...timed, log: true });
  panels("plot-cut", series((c) => c[state.clock] && c[state.clock].cut), timed);
  drawDistributions(all, clock, noClock);
  drawSingular(series, xTitle, marks, still);
  drawPhase(all, scenario);
  for (const text of document.querySelectorAll(".clock-name")) text.textContent = clock.text;
  document.body.dataset.drawn = String(turn);
}

function drawDistributions(all, clock, empty) {
  const traces = all.filter((one) => one.curves[clock.name]).map((one) => {
    const cdf = one.curves[clock.name].cdf;
    return {
      x: cdf.x, y: cdf.y, name: one.name, mode: "lines", line: { color: one.colour, dash: one.dash, width: 2, shape: "hv" },
      hovertemplate: `%{y:.2%} within %{x:.3~g} \u00b5s<extra>${escapeText(one.name)}<br>${one.curves[clock.name].n} samples</extra>`,
    };
  });
  const deadlines = [["4 kHz", 250], ["1 kHz", 1000]];
  draw("plot-cdf", traces, layout(400, {
    xaxis: axis("time [\u00b5s], logarithmic", { type: "log", dtick: 1, minor: { showgrid: true, gridcolor: colour("--soft") } }),
    yaxis: axis("share of solves within", { tickformat: ".0%", range: [0, 1.02] }), showlegend: true, empty,
    shapes: deadlines.map(([, at]) => ({
      type: "line", x0: at, x1: at, y0: 0, y1: 1, yref: "paper", line: { color: colour("--bad"), width: 1, dash: "dash" },
    })),
    annotations: deadlines.map(([text, at]) => ({
      x: Math.log10(at), y: 0.02, yref: "paper", text: "period at " + text, showarrow: false, textangle: -90, xanchor: "right",
      yanchor: "bottom", font: { size: 11, color: colour("--bad") },
    })),
  }));
}

function drawSingular(series, xTitle, marks, still) {
  const rows = [
    ["sigma", "\u03c3 min", {}], ["acceleration", "largest |q\u0308| / limit", {}], ["scale", "share of the pull followed", {}],
  ].filter(([key]) => series((c) => c[key]).length);
  const size = 1 / Math.max(rows.length, 1), traces = [];
  const made = layout(70 + 170 * rows.length, { showlegend: true, xaxis: axis(xTitle, { anchor: "y" + suffix(rows.length - 1) }) });
  rows.forEach(([key, title], index) => {
    made["yaxis" + suffix(index)] = axis(title, {
      domain: [1 - (index + 1) * size + (index < rows.length - 1 ? 0.035 : 0), 1 - index * size], rangemode: "tozero", nticks: 5,
    });
    const lines = series((c) => c[key]);
    lines.forEach((one, place) => {
      traces.push({
        x: one.x, y: one.y, name: one.name, legendgroup: one.name, showlegend: index === 0, yaxis: "y" + suffix(index),
        mode: still ? "markers" : "lines", marker: { color: one.colour, size: 3.5 },
        line: { color: one.colour, width: nested(place, lines.length), dash: one.dash },
        hovertemplate: `%{y:.4~g}<extra>${escapeText(one.name)}</extra>`,
      });
    });
  });
  made.shapes = [...marks];
  const at = rows.findIndex(([key]) => key === "acceleration");
  if (at >= 0) {
    made.shapes.push({
      type: "line", xref: "paper", x0: 0, x1: 1, yref: "y" + suffix(at), y0: 1, y1: 1,
      line: { color: colour("--bad"), width: 1, dash: "dash" },
    });
  }
  draw("plot-singular", traces, made);
}

function drawPhase(all, scenario) {
  const joints = scenario.watched.filter((joint) => all.some((one) => one.curves.phase && one.curves.phase[joint.index]));
  const count = joints.length, gap = 0.09, size = (1 - gap * (count - 1)) / Math.max(count, 1), traces = [];
  const made = layout(470, { showlegend: true });
  joints.forEach((joint, index) => {
    const unit = all.map((one) => one.curves.phase && one.curves.phase[joint.index]).find(Boolean).unit;
    const axes = { xaxis: "x" + suffix(index), yaxis: "y" + suffix(index) }, left = index * (size + gap);
    made["xaxis" + suffix(index)] = axis(`${joint.name}: position [${unit}]`, { domain: [left, left + size], anchor: axes.yaxis });
    made["yaxis" + suffix(index)] = axis(index ? "" : `velocity [${unit}/s]`, { anchor: axes.xaxis });
    const area = scenario.envelopes.find((one) => one.joint === joint.index);
    if (area) {
      const edge = { mode: "lines", hoverinfo: "skip", ...axes };
      traces.push({
        ...edge, x: [...area.q, ...[...area.q].reverse()], y: [...area.viable[0], ...[...area.viable[1]].reverse()], fill: "toself",
        fillcolor: `rgba(${colour("--heat")}, .10)`, line: { color: colour("--muted"), width: 1 }, name: "admissible (viable)",
        legendgroup: "viable", showlegend: index === 0,
      }, {
        ...edge, x: [...area.q, ...[...area.q].reverse()], y: [...area.thesis[0], ...[...area.thesis[1]].reverse()],
        line: { color: colour("--muted"), width: 1, dash: "dot" }, name: "admissible (thesis, eq. 4.11)", legendgroup: "thesis",
        showlegend: index === 0,
      });
    }
    const runs = all.filter((one) => one.curves.phase && one.curves.phase[joint.index]);
    const near = (values, floor) => {
      const low = Math.min(...values), high = Math.max(...values), room = Math.max(0.5 * (high - low), floor);
      return [low - room, high + room];
    };
    made["xaxis" + suffix(index)].range = near(runs.flatMap((one) => one.curves.phase[joint.index].q), 2);
    made["yaxis" + suffix(index)].range = near(runs.flatMap((one) => one.curves.phase[joint.index].qd), 2);
    runs.forEach((one, place) => {
      const phase = one.curves.phase[joint.index];
      traces.push({
        x: phase.q, y: phase.qd, name: one.name, legendgroup: one.name, showlegend: index === 0, mode: "lines", ...axes,
        line: { color: one.colour, width: nested(place, runs.length), dash: one.dash }, customdata: phase.lo.map((low, k) => [low, phase.hi[k]]),
        hovertemplate: `%{x:.4~g} ${unit}, %{y:.4~g} ${unit}/s<br>allowed then: %{customdata[0]:.4~g} to %{customdata[1]:.4~g}` +
          `<extra>${escapeText(one.name)}</extra>`,
      });
    });
  });
  draw("plot-phase", traces, {
    ...made, empty: "This scenario watches no joint, or its states have nothing to do with each other.",
  });
}
