/* The page of an ensemble: a player of one of its runs, means, charts over all runs, and a table of runs. */
"use strict";

/** The player with a choice of runs; `choose(member)` shows another one. */
async function memberPlayer(page, notes) {
  const place = element("div", { class: "member" });
  const select = element("select", { "aria-label": "run", onchange: () => choose(Number(select.value)) },
    ...page.players.map(one => element("option", { value: one.member }, one.label)));
  async function choose(member) {
    const one = page.players.find(p => p.member === member) || page.players[0], state = readState();
    select.value = one.member;
    if (state.member !== String(one.member)) {
      if (window.player) delete state.frame;
      state.member = String(one.member);
      if (window.player) writeState(state);
    }
    if (window.player) window.player.close();
    place.replaceChildren(...[await playerOf({ ...page, player: one.player }, notes)].filter(Boolean));
    if (window.player && place.isConnected) window.player.draw();
  }
  await choose(Number(readState().member));
  window.addEventListener("hashchange", () => choose(Number(readState().member)));
  const root = element("div", { class: "members" }, element("div", { class: "controls" }, element("label", {}, "Run", select),
    page.shown ? element("span", { class: "note" }, page.shown) : null), place);
  return { root, choose };
}

async function ensembleContent(page, notes) {
  const player = page.players.length ? await memberPlayer(page, notes) : null;
  const open = row => {
    player.choose(row.member);
    player.root.scrollIntoView({ block: "start" });
  };
  return [element("div", { class: page.results.length ? "top two" : "top" }, ...[player ? player.root : await playerOf(page, notes),
      page.results.length ? resultsCard(page.results, "Means") : null].filter(Boolean)),
    page.means ? section("Means", element("div", { class: "card scroll" }, sortableTable(page.means.columns, page.means.rows))) : null,
    charts("Charts", page.fits),
    section("Runs", element("div", { class: "card scroll" }, sortableTable(page.columns, page.rows, open))),
    page.common.length ? section("Options that all runs share", parameterTable(page.common)) : null];
}
