/* Builds the page from its data. */
"use strict";

/** Choices of the reader in the address of the page, so that they outlive a reload. */
function readState() {
  return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
}
function writeState(state) {
  history.replaceState(null, "", "#" + new URLSearchParams(state));
}

function header(page) {
  return element("header", {}, element("h1", {}, page.title),
    page.status && element("span", { class: `status ${page.status.tone}` }, page.status.text), element("p", {}, page.subtitle));
}

function remarks(list) {
  return list.length ? element("ul", { class: "remarks" }, ...list.map(text => element("li", {}, text))) : null;
}

function section(title, ...content) {
  return element("section", {}, element("h2", {}, title), ...content);
}

function charts(title, specs, note = "") {
  if (!specs.length && !note) return null;
  return section(title, element("div", { class: "charts" }, ...specs.map(spec => new Chart(spec).root)), note && element("p", { class: "note" }, note));
}

function resultsCard(results, title = "Results") {
  const rows = results.map(r => element("tr", { title: r.name }, element("td", {}, r.label),
    element("td", { class: "value" }, withError(r.value, r.error)), element("td", { class: "unit" }, ...unitNodes(r.unit))));
  return element("aside", { class: "card results" }, element("h3", {}, title),
    rows.length ? element("div", { class: "scroll" }, element("table", {}, ...rows)) : element("p", { class: "note" }, "The run has not ended: its results follow at the end."),
    rows.length ? element("p", { class: "note" }, "± one standard error. Names in summary.json: point at a row.") : null);
}

function parameterTable(list) {
  const row = p => element("tr", {}, element("td", {}, p.name), element("td", { class: "number" }, p.value), element("td", {}, ...unitNodes(p.unit)),
    element("td", { class: "muted" }, p.term || ""));
  const table = rows => element("div", { class: "scroll" }, element("table", {},
    element("tr", {}, ...[["option"], ["value", "number"], ["unit"], ["term"]].map(([text, kind]) => element("th", { class: kind || "" }, text))), ...rows.map(row)));
  const given = list.filter(p => p.given), others = list.filter(p => !p.given);
  return element("div", { class: "card" }, element("h3", {}, "Given options"), given.length ? table(given) : element("p", { class: "note" }, "All options have their defaults."),
    others.length ? element("details", {}, element("summary", {}, `${others.length} options with default values`), table(others)) : null);
}

function detailsCard(details) {
  return element("div", { class: "card" }, element("h3", {}, "Run"), element("div", { class: "scroll" }, element("table", {},
    ...details.map(([label, value]) => element("tr", {}, element("td", { class: "muted" }, label), element("td", { class: "text" }, value))))));
}

/** The player, or the reason why there is none. */
async function playerOf(page, notes) {
  if (!page.player) return element("section", { class: "card" }, element("h3", {}, "No frames"), element("p", { class: "note" }, "There are no frames to show."));
  try {
    const frames = new Frames(page.player, await decodeFrames(page.player.entries));
    window.player = new Player(frames, page.units, readState(), Boolean(page.follow));
    return window.player.root;
  } catch (error) {
    notes.push(error.message);
    return null;
  }
}

/** Reloads the page of a run that goes on; not while the reader watches. */
function follow(seconds) {
  setTimeout(() => {
    if (document.fullscreenElement || (window.player && window.player.playing)) follow(seconds);
    else location.reload();
  }, seconds * 1000);
}

async function build() {
  const page = readPage(), main = document.getElementById("page"), notes = [...page.remarks];
  const content = await { sweep: sweepContent, ensemble: ensembleContent, run: runContent }[page.kind](page, notes);
  main.replaceChildren(...[header(page), remarks(notes), ...content, element("footer", {}, page.footer)].filter(Boolean));
  if (window.player) window.player.draw();
  if (page.follow) follow(page.follow);
  document.documentElement.dataset.ready = "yes";
}

async function runContent(page, notes) {
  const player = await playerOf(page, notes);
  return [element("div", { class: "top two" }, ...[player, resultsCard(page.results)].filter(Boolean)),
    charts("Charts", [...page.fits, ...page.series], page.series_note),
    section("Parameters", element("div", { class: "charts" }, parameterTable(page.parameters), detailsCard(page.details)))];
}

build();
