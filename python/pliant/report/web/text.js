/* Elements, numbers and units. Text reaches the page through text nodes alone, so that names cannot contain markup. */
"use strict";

/** An element with attributes; children are elements or texts. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "class") made.className = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children.filter(child => child !== null && child !== undefined && child !== ""));
  return made;
}

const WORDS = { sigma_avg: ["σ", "avg"], rho: ["ρ", ""], t0: ["t", "0"], F0: ["F", "0"], mu0: ["μ", "0"], zeta0: ["ζ", "0"], R: ["⟨R⟩", ""] };

/** Nodes of a unit such as "sigma_avg^2/t0". */
function unitNodes(unit) {
  const nodes = [];
  for (const part of (unit || "").split(/(\b(?:sigma_avg|rho|t0|F0|mu0|zeta0|R)\b|\^-?[\d.]+|\^\([^)]*\))/)) {
    if (part in WORDS) {
      nodes.push(WORDS[part][0]);
      if (WORDS[part][1]) nodes.push(element("sub", {}, WORDS[part][1]));
    } else if (part.startsWith("^")) nodes.push(element("sup", {}, part.slice(1).replace(/[()]/g, "").replace("-", "−")));
    else if (part) nodes.push(part.replaceAll(" ", "\u2009"));
  }
  return nodes;
}

/** Nodes of "label [unit]". */
function labelNodes(label, unit) {
  return unit ? [label + " [", ...unitNodes(unit), "]"] : [label];
}

/** A number with a few digits. */
function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e6 || size < 1e-4)) {
    const [digit, power] = value.toExponential(Math.min(digits, 3) - 1).split("e");
    const raised = [...String(Number(power))].map(c => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");
    return `${Number(digit)}·10${raised}`.replace("-", "−");
  }
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

/** "1.50 ± 0.03" with the error's digits: two if they begin with 1, else one or two. */
function withError(value, error) {
  if (value === null) return "–";
  if (error === null || !(error > 0)) return number(value);
  const decimals = Math.max(0, 1 - Math.floor(Math.log10(error)));
  return decimals > 6 ? `${number(value)} ± ${number(error, 2)}` : `${value.toFixed(decimals)} ± ${error.toFixed(decimals)}`.replaceAll("-", "−");
}
