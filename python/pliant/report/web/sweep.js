/* Tables that can be sorted, and the page of a sweep: fits, and a table of rows. */
"use strict";

/** `columns`: {name, label, unit, numeric}; `rows`: {cells, name, short, link, status, message}. A click on the link of a row calls open(row). */
function sortableTable(columns, list, open = null) {
  const table = element("table", { class: "sortable" });
  const head = element("tr", {}, ...columns.map((column, i) =>
    element("th", { class: column.numeric ? "number" : "", tabindex: 0, onclick: () => sortBy(i), onkeydown: event => event.key === "Enter" && sortBy(i) },
      ...labelNodes(column.label, column.unit))));
  const cell = (value, column, row) => {
    if (column.name === "row") return element("td", { class: "name", title: row.name }, row.link ? element("a", { href: row.link, ...(open && { onclick: event => { event.preventDefault(); open(row); } }) }, row.short) : row.short);
    if (column.name === "status")
      return element("td", {}, element("span", { class: `status ${row.status.tone}` }, row.status.text), row.message ? element("div", { class: "note" }, row.message) : null);
    if (value === null) return element("td", { class: column.numeric ? "number muted" : "muted" }, "–");
    if (Array.isArray(value)) return element("td", { class: "number" }, withError(...value));
    return element("td", { class: typeof value === "number" ? "number" : "text" }, typeof value === "number" ? number(value, 6) : String(value));
  };
  const rows = list.map(row => ({ row, line: element("tr", {}, ...columns.map((column, i) => cell(row.cells[i], column, row))) }));
  const key = (row, i) => {
    const name = columns[i].name, value = name === "row" ? row.name : name === "status" ? row.status.text : row.cells[i];
    return Array.isArray(value) ? value[0] : value;
  };
  let sorted = null;
  function sortBy(i) {
    const down = sorted === i && head.children[i].getAttribute("aria-sort") === "ascending";
    sorted = i;
    [...head.children].forEach(th => th.removeAttribute("aria-sort"));
    head.children[i].setAttribute("aria-sort", down ? "descending" : "ascending");
    const compare = (a, b) => a === null ? 1 : b === null ? -1 : typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
    const order = [...rows].sort((a, b) => compare(key(a.row, i), key(b.row, i)) * (down ? -1 : 1));
    table.tBodies[0].replaceChildren(...order.map(one => one.line));
  }
  table.append(element("thead", {}, head), element("tbody", {}, ...rows.map(one => one.line)));
  return table;
}

function sweepContent(page) {
  return [charts("Fits", page.fits), section("Rows", element("div", { class: "card scroll" }, sortableTable(page.columns, page.rows))),
    page.common.length ? section("Options that all rows share", parameterTable(page.common)) : null];
}
