// The table of all cells: sorts by any column, filters by words and by comparisons such as p99<50.
const table = { sort: null, down: false, limit: 100, rows: [] };
const FIXED = [["scenario", "scenario"], ["formulation", "formulation"], ["solver", "solver"], ["start", "start"], ["state", "state"]];
// Some measures stand in two groups.
const ONCE = REPORT.columns.filter((column, place, all) => all.findIndex((one) => one.key === column.key) === place);
const COMPARE = /^([\w.]+)(<=|>=|<|>|=)(-?[\d.]+(?:e[+-]?\d+)?)$/i;

function valueOf(cell, key) {
  if (key in cell && key !== "values") return cell[key];
  const column = REPORT.columns.find((one) => one.key === key);
  return !column || !cell.values ? null : cell.values[column.at];
}
// What is typed is in the unit that is shown.
function shownValue(cell, key) {
  const value = valueOf(cell, key), column = REPORT.columns.find((one) => one.key === key);
  if (typeof value !== "number" || !column) return value;
  return column.format === "us" ? 1e6 * value : column.format === "percent" ? 100 * value : value;
}
function matcher(text) {
  const keys = new Set([...REPORT.columns.map((column) => column.key), ...FIXED.map(([key]) => key)]);
  const tests = text.toLowerCase().split(/\s+/).filter(Boolean).map((word) => {
    const found = word.match(COMPARE);
    if (!found || !keys.has(found[1])) {
      return (cell) => FIXED.some(([key]) => String(cell[key]).toLowerCase().includes(word));
    }
    const [, key, sign, digits] = found, limit = Number(digits);
    return (cell) => {
      const value = Number(shownValue(cell, key) ?? NaN);
      return { "<": value < limit, "<=": value <= limit, ">": value > limit, ">=": value >= limit, "=": value === limit }[sign];
    };
  });
  return (cell) => tests.every((test) => test(cell));
}
function compare(a, b) {
  const missing = (value) => value === null || value === undefined;
  if (missing(a) || missing(b)) return missing(a) - missing(b);  // what is missing comes last, whichever way
  const order = typeof a === "string" ? a.localeCompare(b, "en", { numeric: true }) : a - b;
  return table.down ? -order : order;
}

function refreshTable() {
  const passes = matcher(byId("filter").value);
  const only = Object.fromEntries(["scenario", "formulation", "solver", "start", "state"].map((key) => [key, byId("only-" + key).value]));
  table.rows = REPORT.cells.filter((cell) => Object.entries(only).every(([key, value]) => !value || cell[key] === value) && passes(cell));
  if (table.sort) table.rows.sort((a, b) => compare(valueOf(a, table.sort), valueOf(b, table.sort)));
  fillTable();
}
function fillTable() {
  const group = byId("group").value;
  const columns = group === "all" ? ONCE : REPORT.columns.filter((column) => column.group === group);
  const head = element("tr");
  for (const [key, label] of FIXED) head.append(headCell(key, label, "", "What it is."));
  for (const column of columns) head.append(headCell(column.key, column.label, column.unit, column.help, "num"));
  const body = document.createDocumentFragment();
  for (const cell of table.rows.slice(0, table.limit)) {
    const row = element("tr", null, { "data-cell": cell.id });
    for (const [key] of FIXED) row.append(element("td", cell[key], key === "state" && cell.state !== "ok" ? { class: "bad", title: cell.reason } : {}));
    for (const column of columns) {
      const value = valueOf(cell, column.key);
      const bad = column.bad_above !== null && typeof value === "number" && value > column.bad_above;
      row.append(element("td", number(value, column.format), { class: "num" + (value === null ? " none" : bad ? " bad" : "") }));
    }
    body.append(row);
  }
  const holder = byId("cells-table");
  holder.tHead.replaceChildren(head);
  holder.tBodies[0].replaceChildren(body);
  const shown = Math.min(table.limit, table.rows.length);
  byId("count").textContent = `${table.rows.length.toLocaleString("en")} of ${REPORT.cells.length.toLocaleString("en")} cells` +
    (shown < table.rows.length ? `, ${shown} shown` : "");
  byId("more").hidden = shown >= table.rows.length;
}
function headCell(key, label, unit, help, kind = "") {
  const cell = element("th", null, { scope: "col", class: kind, "data-key": key, title: `${help} (filter name: ${key})` });
  const press = element("button", label, { type: "button" });
  if (unit) press.append(element("small", unit));
  press.addEventListener("click", () => {
    table.down = table.sort === key && !table.down;
    table.sort = key;
    refreshTable();
  });
  if (table.sort === key) cell.setAttribute("aria-sort", table.down ? "descending" : "ascending");
  cell.append(press);
  return cell;
}
function saveCsv() {
  const quote = (value) => (/[",\n]/.test(value) ? `"${value.replace(/"/g, '""')}"` : value);
  const keys = [...FIXED.map(([key]) => key), ...ONCE.map((column) => column.key)];
  const lines = table.rows.map((cell) => keys.map((key) => quote(String(valueOf(cell, key) ?? ""))).join(","));
  const link = element("a", null, { download: "cells.csv" });
  link.href = URL.createObjectURL(new Blob([[keys.join(","), ...lines].join("\n") + "\n"], { type: "text/csv" }));
  link.click();
  URL.revokeObjectURL(link.href);
}
