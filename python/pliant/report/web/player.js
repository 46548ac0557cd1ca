/* The player: frames on a canvas with slider, colours, forces, full screen and keyboard. */
"use strict";

const ICONS = {
  play: "M3 1.5v13l11-6.5z", pause: "M3 1.5h4v13H3zM9 1.5h4v13H9z", back: "M13 1.5v13L4.5 8zM2 1.5h2.2v13H2z", next: "M3 1.5v13L11.5 8zM11.8 1.5H14v13h-2.2z",
  full: "M1.5 1.5h5v2h-3v3h-2zM9.5 1.5h5v5h-2v-3h-3zM1.5 9.5h2v3h3v2h-5zM12.5 9.5h2v5h-5v-2h3z",
  fit: "M8 2.2a5.8 5.8 0 1 0 5.6 7.3h-2.1A3.8 3.8 0 1 1 8 4.2c1 0 1.9.4 2.6 1L8.3 7.5H14v-5.700l-2 2A5.8 5.8 0 0 0 8 2.2z",
};
const SPEEDS = [0.25, 0.5, 1, 2, 4];
const FRAMES_PER_SECOND = 25, DURATION = 8;  // s of a run with few frames

function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

class Player {
  /** `state` keeps the choices of the reader: colour, forces, cut, speed, frame. */
  constructor(frames, units, state, live) {
    Object.assign(this, { frames, units, state, live, playing: false, speed: 1, closing: new AbortController() });
    this.rate = Math.max(1, Math.min(FRAMES_PER_SECOND, frames.count / DURATION));
    this._build();
    this.scene = new Scene(this.canvas, frames);
    this._restore();
    this._listen();
    const first = this._firstFrame(), unseen = this.unseen;
    this.show(first);
    this.unseen = unseen;
  }

  _build() {
    const { frames } = this, button = (name, title, action, main = false) =>
      element("button", { type: "button", title, "aria-label": title, class: main ? "main" : "", onclick: action }, icon(name));
    this.canvas = element("canvas", { role: "img", "aria-label": "particles of the shown frame" });
    this.tip = element("div", { class: "tip", hidden: true });
    this.legend = element("div", { class: "scales" });
    this.stage = element("div", { class: "stage" }, this.canvas, this.tip);
    this.playButton = button("play", "Play (space)", () => this.toggle(), true);
    this.slider = element("input", { type: "range", class: "slider", min: 0, max: frames.count - 1, value: 0, "aria-label": "frame",
                                     oninput: () => { this.pause(); this.show(Number(this.slider.value)); this._rememberFrame(); } });
    this.clock = element("span", { class: "time" });
    this.colours = element("select", { "aria-label": "colour", onchange: () => this.colourBy(this.colours.value) },
      ...frames.quantities.map(q => element("option", { value: q.name }, q.label)), element("option", { value: "none" }, "nothing"));
    this.speeds = element("select", { "aria-label": "speed", onchange: () => this.setSpeed(Number(this.speeds.value)) },
      ...SPEEDS.map(s => element("option", { value: s, selected: s === 1 }, `${s}×`)));
    this.forceBox = element("input", { type: "checkbox", onchange: () => this.showForces(this.forceBox.checked) });
    this.cutBox = element("input", { type: "checkbox", checked: true, onchange: () => this.cutOpen(this.cutBox.checked) });
    const key = (name, text) => [element("kbd", {}, name), ` ${text}  `];
    this.keys = element("p", { class: "keys" }, ...key("space", "play"), ...key("← →", "one frame"), ...key("Home End", "first, last"),
      ...key("c", "colour"), ...(frames.hasForces ? key("f", "forces") : []), ...(frames.dim === 3 ? key("x", "cut") : []), ...key("+ −", "zoom"),
      ...key("0", "whole view"), ...key("Enter", "full screen."),
      frames.dim === 3 ? "Drag to rotate, drag with Shift to move, wheel to zoom." : "Drag to move, wheel to zoom; point at a particle for its values.");
    this.root = element("section", { class: "card player", tabindex: 0, "aria-label": "player" }, this.legend, this.stage,
      element("div", { class: "controls" }, button("back", "Back one frame (←)", () => this.step(-1)), this.playButton,
        button("next", "Forward one frame (→)", () => this.step(1)), this.slider, this.clock),
      element("div", { class: "controls" }, element("label", {}, "Colour", this.colours), element("label", {}, "Speed", this.speeds),
        frames.hasForces ? element("label", {}, this.forceBox, frames.data.signed ? "Bond forces" : "Contact forces") : null,
        frames.dim === 3 ? element("label", {}, this.cutBox, "Cut open") : null,
        button("fit", "Whole view (0)", () => { this.scene.view.reset(); this.draw(); }), button("full", "Full screen (Enter)", () => this.fullScreen())),
      this.keys);
  }

  /** Of droplets the bonds are of interest, and hardly their speed. */
  get _usualColour() {
    const names = this.frames.quantities.map(q => q.name);
    return this.frames.data.signed && names.includes("contacts") ? "contacts" : names[0];
  }
  get _usualForces() { return this.frames.data.signed ? "yes" : "no"; }

  _restore() {
    const { state, frames } = this;
    const name = frames.quantities.some(q => q.name === state.colour) || state.colour === "none" ? state.colour : this._usualColour;
    this.colours.value = name;
    this.colourBy(name);
    this.speeds.value = SPEEDS.includes(Number(state.speed)) ? state.speed : 1;
    this.speed = Number(this.speeds.value);
    this.forceBox.checked = this.scene.forces = frames.hasForces && (state.forces || this._usualForces) === "yes";
    this.cutBox.checked = this.scene.cut = state.cut !== "no";
    this._describeScale();
  }

  /** The frame that the reader has chosen; else the newest one of a run that goes on, and one from the middle of an ended run. */
  _firstFrame() {
    const given = parseInt(this.state.frame, 10), last = this.frames.count - 1;
    if (given >= 0 && given <= last) return given;
    this.unseen = !this.live;
    return this.live ? last : Math.ceil(last / 2);
  }

  // ---- actions ----------------------------------------------------------------------------------------------------------

  show(index) {
    this.unseen = false;
    this.frames.load(Math.max(0, Math.min(this.frames.count - 1, index)));
    this.slider.value = this.frames.index;
    const { data, time, count } = this.frames, i = this.frames.index;
    this.clock.replaceChildren(`t = ${this._clockText(time)} `, ...unitNodes(this.units.time), ` · frame ${data.indices[i] + 1} of ${data.total}`);
    this.slider.setAttribute("aria-valuetext", `frame ${i + 1} of ${count}`);
    this.tip.hidden = true;
    this.draw();
  }
  _clockText(time) {
    const last = Math.abs(this.frames.data.times.at(-1));
    return time.toFixed(last >= 1000 ? 0 : last >= 100 ? 1 : last >= 1 ? 2 : 4).replace("-", "−");
  }
  draw() {
    this.scene.draw();
  }
  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }
  play() {
    if (this.frames.count < 2) return;
    if (this.unseen || this.frames.index === this.frames.count - 1) this.show(0);
    this._setPlaying(true);
    let last = performance.now(), due = 0;
    const tick = now => {
      if (!this.playing) return;
      due += (now - last) / 1000 * this.rate * this.speed;
      last = now;
      const steps = Math.floor(due);
      due -= steps;
      if (steps > 0) {
        const next = Math.min(this.frames.index + steps, this.frames.count - 1);
        this.show(next);
        if (next === this.frames.count - 1) return this.pause();
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  pause() {
    if (!this.playing) return;
    this._setPlaying(false);
    this._rememberFrame();
  }
  /** A run that goes on shows its newest frame again after a reload, unless the reader has chosen an earlier one. */
  _rememberFrame() {
    this._remember("frame", this.live && this.frames.index === this.frames.count - 1 ? null : this.frames.index);
  }
  _setPlaying(on) {
    this.playing = on;
    this.playButton.replaceChildren(icon(on ? "pause" : "play"));
    this.playButton.title = on ? "Pause (space)" : "Play (space)";
    this.playButton.setAttribute("aria-label", this.playButton.title);
  }
  step(by) {
    this.pause();
    this.show(this.frames.index + by);
    this._rememberFrame();
  }
  colourBy(name) {
    this.scene.quantity = this.frames.quantities.find(q => q.name === name) || null;
    this._remember("colour", name === this._usualColour ? null : name);
    this._describeScale();
    this.draw();
  }
  setSpeed(speed) {
    this.speed = speed;
    this._remember("speed", speed === 1 ? null : speed);
  }
  showForces(on) {
    this.forceBox.checked = this.scene.forces = on;
    this._remember("forces", (on ? "yes" : "no") === this._usualForces ? null : on ? "yes" : "no");
    this._describeScale();
    this.draw();
  }
  cutOpen(on) {
    this.cutBox.checked = this.scene.cut = on;
    this._remember("cut", on ? null : "no");
    this.draw();
  }
  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else if (this.root.requestFullscreen) this.root.requestFullscreen().catch(() => {});
  }
  _remember(name, value) {
    if (value === null) delete this.state[name];
    else this.state[name] = String(value);
    writeState(this.state);
  }

  /** The colour bars above the picture. */
  _describeScale() {
    const { quantity, scale } = this.scene, { frames } = this, parts = [];
    const bar = (label, unit, gradient, low, high) => parts.push(element("div", {}, element("span", {}, ...labelNodes(label, unit)),
      element("span", { class: "end" }, low), element("span", { class: "bar", style: `background:${gradient}` }), element("span", { class: "end" }, high)));
    const key = (colour, text) => parts.push(element("div", {}, element("span", { class: "key", style: `background:var(--${colour})` }), text));
    if (quantity && quantity.kind !== "ids") {
      const [low, high] = quantity.range;
      bar(quantity.label, quantity.unit, scale.gradient(), (quantity.least < low ? "≤ " : "") + number(low, 3), (quantity.most > high ? "≥ " : "") + number(high, 3));
    }
    if (this.scene.forces && frames.data.signed) {
      key("tension", "attraction");
      key("compression", "repulsion");
    } else if (this.scene.forces) bar("contact force", frames.data.force_unit, this.scene.forceGradient, "0", "≥ " + number(frames.strong, 3));
    this.legend.replaceChildren(...parts);
  }

  /** Another player takes its place on the page. */
  close() {
    this._setPlaying(false);
    this.closing.abort();
  }

  // ---- events -----------------------------------------------------------------------------------------------------------

  _listen() {
    const { x0, x1, y0, y1 } = this.scene.view.box;
    this.stage.style.aspectRatio = this.frames.dim === 3 ? "" : (x1 - x0) / (y1 - y0);
    const { signal } = this.closing, resized = new ResizeObserver(() => this.draw());
    resized.observe(this.stage);
    signal.addEventListener("abort", () => resized.disconnect());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.scene.readTheme();
      this._describeScale();
      this.draw();
    }, { signal });
    document.addEventListener("keydown", event => this._key(event), { signal });
    const { canvas } = this;
    let from = null;
    canvas.addEventListener("pointerdown", event => {
      from = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", () => { from = null; });
    canvas.addEventListener("pointercancel", () => { from = null; });
    canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    canvas.addEventListener("pointermove", event => {
      if (!from) return this._point(event);
      const dx = event.clientX - from[0], dy = event.clientY - from[1];
      from = [event.clientX, event.clientY];
      if (this.frames.dim === 3 && !event.shiftKey) this.scene.view.rotate(dx, dy);
      else this.scene.view.pan(dx, dy);
      this.draw();
    });
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.scene.view.magnify(Math.exp(-event.deltaY / 500), event.offsetX, event.offsetY);
      this.draw();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.scene.view.reset(); this.draw(); });
  }

  _key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select, summary, a, input[type=text]")) return;
    const onButton = event.target.closest("button, input"), middle = [this.scene.view.width / 2, this.scene.view.height / 2];
    const zoom = factor => { this.scene.view.magnify(factor, ...middle); this.draw(); };
    const actions = {
      " ": onButton ? null : () => this.toggle(), ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1),
      Home: () => this.step(-this.frames.count), End: () => this.step(this.frames.count),
      c: () => this._nextColour(), f: this.frames.hasForces ? () => this.showForces(!this.scene.forces) : null,
      x: this.frames.dim === 3 ? () => this.cutOpen(!this.scene.cut) : null, "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8),
      0: () => { this.scene.view.reset(); this.draw(); }, Enter: onButton ? null : () => this.fullScreen(),
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }
  _nextColour() {
    const names = [...this.colours.options].map(option => option.value), at = names.indexOf(this.colours.value);
    this.colours.value = names[(at + 1) % names.length];
    this.colourBy(this.colours.value);
  }

  /** Number and values of the particle under the pointer. */
  _point(event) {
    const m = this.scene.particleAt(event.offsetX, event.offsetY);
    this.tip.hidden = m < 0;
    if (m < 0) return;
    const lines = this.frames.quantities.filter(q => q.kind !== "ids").map(q =>
      element("div", {}, `${q.label} `, element("b", {}, number(this.frames.value(q, m), 3)), " ", ...unitNodes(q.unit)));
    this.tip.replaceChildren(element("div", {}, element("b", {}, `particle ${m}`)), ...lines);
    const { width, height } = this.scene.view;
    this.tip.style.left = event.offsetX > width / 2 ? "" : `${event.offsetX + 14}px`;
    this.tip.style.right = event.offsetX > width / 2 ? `${width - event.offsetX + 14}px` : "";
    this.tip.style.top = event.offsetY > height / 2 ? "" : `${event.offsetY + 10}px`;
    this.tip.style.bottom = event.offsetY > height / 2 ? `${height - event.offsetY + 10}px` : "";
  }
}
