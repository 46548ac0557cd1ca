/* Line charts as SVG, with marks, spans, errors and a readout under the pointer. */
"use strict";

const CHART = { width: 400, height: 210, left: 52, right: 12, top: 8, bottom: 22 };

function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** Round numbers between two ends. */
function ticks(low, high, most = 6) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = power * [1, 2, 5, 10].find(f => f * power >= raw * 0.999);
  const result = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) result.push(i * step);
  return result;
}

function ends(values, keepZero = false) {
  const known = values.filter(v => v !== null && Number.isFinite(v));
  let low = known.length ? Math.min(...known) : 0, high = known.length ? Math.max(...known) : 1;
  if (keepZero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  if (high === low) [low, high] = low === 0 ? [0, 1] : [low - 0.1 * Math.abs(low), high + 0.1 * Math.abs(high)];
  const margin = 0.04 * (high - low);
  return [low === 0 && keepZero ? 0 : low - margin, high + margin];
}

class Chart {
  /** `spec`: title, unit, x {label, unit, reversed}, lines [{x, y, error, kind, label, colour, small}], marks, spans, note, zero. */
  constructor(spec) {
    this.spec = spec;
    this.root = element("article", { class: "card chart" }, element("h3", {}, ...labelNodes(spec.title, spec.unit)));
    if (spec.lines.some(line => line.label)) this.root.append(this._legend());
    this._plot();
    this.root.append(element("div", { class: "x" }, ...labelNodes(spec.x.label, spec.x.unit)));
    if (spec.note) this.root.append(element("p", { class: "note" }, spec.note));
  }

  _colour(line, i) { return `var(--c${(line.colour ?? i) % 8})`; }

  _legend() {
    return element("div", { class: "legend" }, ...this.spec.lines.map((line, i) => line.label && element("span", { style: `color:${this._colour(line, i)}` },
      element("i", { class: line.kind === "points" ? "points" : "", style: line.dashed ? "border-top-style:dashed" : "" }), line.label)).filter(Boolean));
  }

  _plot() {
    const { spec } = this, { width, height, left, right, top, bottom } = CHART, xs = spec.lines.flatMap(line => line.x);
    const ys = spec.lines.flatMap(line => [...line.y, ...(line.error ? line.y.flatMap((y, i) => line.error[i] === null ? [] : [y - line.error[i], y + line.error[i]]) : []),
                                           ...(line.low || []), ...(line.high || [])]);
    let [x0, x1] = ends(xs);
    if (!spec.lines.some(line => line.kind === "points")) [x0, x1] = [Math.min(...xs), Math.max(...xs)];
    if (!(x1 > x0)) [x0, x1] = [x0 - 0.5, x0 + 0.5];
    const [y0, y1] = ends(ys, spec.zero);
    const along = x => (x - x0) / (x1 - x0);
    this.px = x => left + (spec.x.reversed ? 1 - along(x) : along(x)) * (width - left - right);
    this.py = y => height - bottom - (y - y0) / (y1 - y0) * (height - top - bottom);
    this.svg = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": spec.title });
    this._spans(x0, x1);
    for (const y of ticks(y0, y1, 5)) {
      this.svg.append(svg("line", { class: "grid", x1: left, x2: width - right, y1: this.py(y), y2: this.py(y) }),
        svg("text", { x: left - 6, y: this.py(y) + 4, "text-anchor": "end" }, number(y, 4)));
    }
    for (const x of ticks(x0, x1, 6)) this.svg.append(svg("text", { x: this.px(x), y: height - 6, "text-anchor": "middle" }, number(x, 5)));
    this.svg.append(svg("line", { class: "axis", x1: left, x2: width - right, y1: height - bottom, y2: height - bottom }));
    spec.lines.forEach((line, i) => this._line(line, this._colour(line, i)));
    this._marks();
    this._readout();
    this.root.append(this.svg);
  }

  _spans(x0, x1) {
    for (const { from, to } of this.spec.spans || []) {
      const a = this.px(Math.max(from, x0)), b = this.px(Math.min(to, x1));
      this.svg.append(svg("rect", { x: Math.min(a, b), width: Math.abs(b - a), y: CHART.top, height: CHART.height - CHART.top - CHART.bottom, fill: "var(--line)", opacity: 0.5 }));
    }
  }

  _marks() {
    for (const { x, text } of this.spec.marks || []) {
      const at = this.px(x), late = at > 0.7 * CHART.width;
      this.svg.append(svg("line", { x1: at, x2: at, y1: CHART.top, y2: CHART.height - CHART.bottom, stroke: "var(--soft)", "stroke-dasharray": "4 3" }),
        svg("text", { x: at + (late ? -4 : 4), y: CHART.top + 9, "text-anchor": late ? "end" : "start" }, text));
    }
  }

  _path(xs, ys, steps) {
    let path = "", pen = false;
    xs.forEach((x, i) => {
      const y = ys[i];
      if (y === null || y === undefined) { pen = false; return; }
      if (steps) {
        if (i + 1 < xs.length) path += `${pen ? "L" : "M"}${this.px(x).toFixed(1)} ${this.py(y).toFixed(1)}L${this.px(xs[i + 1]).toFixed(1)} ${this.py(y).toFixed(1)}`;
      } else path += `${pen ? "L" : "M"}${this.px(x).toFixed(1)} ${this.py(y).toFixed(1)}`;
      pen = true;
    });
    return path;
  }

  _line(line, colour) {
    if (line.low) {
      const forward = line.x.map((x, i) => `${this.px(x).toFixed(1)} ${this.py(line.low[i] ?? line.y[i]).toFixed(1)}`);
      const back = line.x.map((x, i) => `${this.px(x).toFixed(1)} ${this.py(line.high[i] ?? line.y[i]).toFixed(1)}`).reverse();
      this.svg.append(svg("path", { d: `M${[...forward, ...back].join("L")}Z`, fill: colour, opacity: 0.2 }));
    }
    if (line.kind === "points") {
      line.x.forEach((x, i) => {
        if (line.y[i] === null) return;
        const cx = this.px(x), error = line.error && line.error[i];
        if (error) this.svg.append(svg("line", { x1: cx, x2: cx, y1: this.py(line.y[i] - error), y2: this.py(line.y[i] + error), stroke: colour, "stroke-width": 1.3 }));
        this.svg.append(svg("circle", { cx, cy: this.py(line.y[i]), r: line.small ? 2 : 3.4, fill: colour }));
      });
      return;
    }
    this.svg.append(svg("path", { d: this._path(line.x, line.y, line.kind === "steps"), fill: "none", stroke: colour, "stroke-width": 1.5, "stroke-linejoin": "round",
                                  ...(line.dashed ? { "stroke-dasharray": "5 4" } : {}) }));
  }

  /** Values of the point nearest to the pointer. */
  _readout() {
    const dot = svg("circle", { r: 3.5, fill: "none", stroke: "var(--text)", visibility: "hidden" });
    const text = svg("text", { class: "readout", y: CHART.top + 9, x: CHART.width - CHART.right, "text-anchor": "end" });
    this.svg.append(dot, text);
    this.svg.addEventListener("pointermove", event => {
      const box = this.svg.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * CHART.width, y = (event.clientY - box.top) / box.height * CHART.height;
      let best = null, least = Infinity;
      for (const line of this.spec.lines)
        line.x.forEach((value, i) => {
          if (line.y[i] === null || line.y[i] === undefined) return;
          const distance = Math.abs(this.px(value) - x) + 0.15 * Math.abs(this.py(line.y[i]) - y);
          if (distance < least) [least, best] = [distance, [value, line.y[i]]];
        });
      if (!best) return;
      dot.setAttribute("cx", this.px(best[0]));
      dot.setAttribute("cy", this.py(best[1]));
      dot.setAttribute("visibility", "visible");
      text.textContent = `${number(best[0])}: ${number(best[1])}`;
    });
    this.svg.addEventListener("pointerleave", () => {
      dot.setAttribute("visibility", "hidden");
      text.textContent = "";
    });
  }
}
