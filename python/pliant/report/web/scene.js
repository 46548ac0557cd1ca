/* Draws a frame on a canvas: 2D runs as they are, 3D runs as shaded spheres that can be rotated. */
"use strict";

/** Colours of the page's theme, read again when the theme changes. */
function themeColours() {
  const style = getComputedStyle(document.documentElement);
  const colour = name => {
    const text = style.getPropertyValue(`--${name}`).trim();
    return { text, rgb: rgbOf(text) };
  };
  return Object.fromEntries(["canvas", "wall", "pale", "soft", "text", "tension", "compression"].map(name => [name, colour(name)]));
}

/** Place and size of the picture; a 3D view also has two angles. */
class View {
  constructor(frames) {
    this.frames = frames;
    const [x0, x1, y0, y1] = frames.data.view;
    this.box = { x0, x1, y0, y1 };
    this.reset();
  }
  reset() {
    const { x0, x1, y0, y1 } = this.box;
    Object.assign(this, { x: (x0 + x1) / 2, y: (y0 + y1) / 2, zoom: 1, azimuth: 0.5, elevation: 0.22 });
  }
  resize(width, height) {
    const { x0, x1, y0, y1 } = this.box, [w, h] = this.frames.dim === 3 ? [1.05 * (x1 - x0), 1.15 * (y1 - y0)] : [x1 - x0, y1 - y0];
    Object.assign(this, { width, height, fitted: Math.min(width / w, height / h) });
  }
  get scale() { return this.fitted * this.zoom; }

  /** Sets the directions of a 3D view for the calls of `project` that follow. */
  turn() {
    [this.ca, this.sa, this.ce, this.se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
  }
  /** [x, y on the canvas, depth towards the viewer, distance in front of the axis]. */
  project(x, y, z = 0) {
    if (this.frames.dim === 2) return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale, 0, 0];
    const middle = (this.box.y0 + this.box.y1) / 2, across = x * this.ca + y * this.sa, front = x * this.sa - y * this.ca, up = z - middle;
    return [this.width / 2 + (across - this.x) * this.scale, this.height / 2 - (up * this.ce - front * this.se - this.y + middle) * this.scale,
            front * this.ce + up * this.se, front];
  }
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }
  rotate(dx, dy) {
    this.azimuth += dx / 150;
    this.elevation = Math.max(-1.55, Math.min(1.55, this.elevation + dy / 150));
  }
  /** Zooms so that the point under the pointer stays there. */
  magnify(factor, px, py) {
    const before = this.scale;
    this.zoom = Math.max(0.3, Math.min(60, this.zoom * factor));
    const shift = 1 / before - 1 / this.scale;
    this.x += (px - this.width / 2) * shift;
    this.y -= (py - this.height / 2) * shift;
  }
}

class Scene {
  constructor(canvas, frames) {
    Object.assign(this, { canvas, frames, view: new View(frames), _quantity: frames.quantities[0], _forces: false, cut: true });
    this.context = canvas.getContext("2d");
    this.readTheme();
  }

  readTheme() {
    this.theme = themeColours();
    this._dark = this.theme.canvas.rgb[0] < 128;
    this._forceColours = this._dark ? colourMap("magma", 0.38, 1) : colourMap("magma", 0.8, 0.05);
    this.quantity = this._quantity;
  }

  get quantity() { return this._quantity; }
  set quantity(quantity) {
    this._quantity = quantity;
    this.scale = quantity && new ColourScale(quantity, this._dark);
    this._sprites = new Map();
  }
  get forces() { return this._forces; }
  set forces(on) {
    this._forces = on;
    this._sprites = new Map();
  }
  get forceGradient() {
    return `linear-gradient(to right, ${this._forceColours.map(css).join(",")})`;
  }

  draw() {
    const { canvas, context, view } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    view.resize(width, height);
    view.turn();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.theme.canvas.text;
    context.fillRect(0, 0, width, height);
    context.lineCap = context.lineJoin = "round";
    if (this.frames.dim === 3) this._draw3D();
    else this._draw2D();
  }

  // ---- 2D -------------------------------------------------------------------------------------------------------------

  _draw2D() {
    this._drawBox();
    this._drawWalls();
    const { frames } = this;
    for (let m = 0; m < frames.particles; m++) {
      if (!frames.shown[m]) continue;
      const colour = this._colour(m);
      if (frames.deformable) this._drawPolygon(m, colour);
      else this._drawDisk(m, colour);
    }
    if (this.forces) this._drawForces();
  }

  /** Colour [r, g, b] of a particle; pale under the force network. */
  _colour(m) {
    const value = this.quantity ? this.frames.value(this.quantity, m) : NaN;
    const rgb = Number.isNaN(value) ? this.theme.pale.rgb : this.scale.colours[this.scale.index(value)];
    return this.forces ? mix(rgb, this.theme.canvas.rgb, 0.68) : rgb;
  }

  _edge(rgb) {
    return css(mix(rgb, this._dark ? [0, 0, 0] : [20, 24, 30], this.forces ? 0.1 : 0.3));
  }

  _drawPolygon(m, rgb) {
    const { context, frames, view } = this, { offset, outline } = frames.arrays, at = frames.position;
    context.beginPath();
    for (let p = offset[m]; p < offset[m + 1]; p++) {
      const [x, y] = view.project(at[2 * p], at[2 * p + 1]);
      if (p === offset[m]) context.moveTo(x, y);
      else context.lineTo(x, y);
    }
    context.closePath();
    context.fillStyle = css(rgb);
    context.strokeStyle = this._edge(rgb);
    context.lineWidth = Math.max(outline[m] * view.scale, 0.6);
    context.fill();
    context.stroke();
  }

  _drawDisk(m, rgb) {
    const { context, frames, view } = this, [x, y] = view.project(frames.centre[2 * m], frames.centre[2 * m + 1]);
    const radius = frames.arrays.diameter[m] / 2 * view.scale, line = Math.min(1, 0.15 * radius);
    if (x < -radius || y < -radius || x > view.width + radius || y > view.height + radius) return;
    context.beginPath();
    context.arc(x, y, Math.max(radius - line / 2, 0.3), 0, 2 * Math.PI);
    context.fillStyle = css(rgb);
    context.fill();
    context.strokeStyle = this._edge(rgb);
    context.lineWidth = line;
    const angle = frames.angle(m);
    if (angle !== null && radius > 2.5) {
      context.moveTo(x, y);
      context.lineTo(x + radius * Math.cos(angle), y - radius * Math.sin(angle));
    }
    context.stroke();
  }

  _drawWalls() {
    const { context, view } = this, walls = this.frames.walls;
    context.strokeStyle = this.theme.wall.text;
    context.lineWidth = 3;
    context.beginPath();
    for (let i = 0; i < walls.length; i += 4) {
      if (Number.isNaN(walls[i])) continue;
      context.moveTo(...view.project(walls[i], walls[i + 1]).slice(0, 2));
      context.lineTo(...view.project(walls[i + 2], walls[i + 3]).slice(0, 2));
    }
    context.stroke();
  }

  /** The periodic box, dashed where it is finite. */
  _drawBox() {
    const { box } = this.frames.data;
    if (!box) return;
    const [x0, y0] = box[0], [w, h] = box[1], { context, view } = this, far = 1e4;
    context.strokeStyle = this.theme.soft.text;
    context.lineWidth = 1;
    context.setLineDash([5, 4]);
    context.beginPath();
    const [bottom, top] = h === null ? [-far, far] : [y0, y0 + h], [left, right] = w === null ? [-far, far] : [x0, x0 + w];
    const line = (a, b, c, d) => {
      context.moveTo(...view.project(a, b).slice(0, 2));
      context.lineTo(...view.project(c, d).slice(0, 2));
    };
    if (w !== null) for (const x of [left, right]) line(x, bottom, x, top);
    if (h !== null) for (const y of [bottom, top]) line(left, y, right, y);
    context.stroke();
    context.setLineDash([]);
  }

  _drawForces() {
    const { context, frames, view } = this, widest = 0.35 * frames.data.mean_diameter * view.scale;
    const lines = [];
    frames.eachForce((start, end, force) => lines.push([start, end, force]));
    lines.sort((a, b) => Math.abs(a[2]) - Math.abs(b[2]));
    for (const [start, end, force] of lines) {
      const share = Math.min(Math.abs(force) / frames.strong, 1);
      if (share === 0) continue;
      const [a, b] = [view.project(...start), view.project(...end)];
      if (frames.dim === 3 && this.cut && Math.max(a[3], b[3]) > 0) continue;
      context.strokeStyle = frames.data.signed ? this.theme[force < 0 ? "tension" : "compression"].text
        : css(this._forceColours[Math.round(share * (STEPS - 1))]);
      context.lineWidth = Math.max(share * widest, 0.5);
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.stroke();
    }
  }

  // ---- 3D -------------------------------------------------------------------------------------------------------------

  _draw3D() {
    this._drawShell(false);
    const { frames, view, context } = this, order = this._fromBehind();
    for (const m of order) {
      const c = 3 * m, [x, y, depth] = view.project(frames.centre[c], frames.centre[c + 1], frames.centre[c + 2]);
      const radius = frames.arrays.diameter[m] / 2 * view.scale;
      if (x < -radius || y < -radius || x > view.width + radius || y > view.height + radius) continue;
      if (frames.surfaces) this._drawSurface(m, depth);
      else context.drawImage(this._sprite(m, depth), x - radius, y - radius, 2 * radius, 2 * radius);
    }
    if (this.forces) this._drawForces();
    if (!this.cut) this._drawShell(true);
  }

  /** The faces of a surface that are turned to the viewer, the hindmost first, lit from the upper left. */
  _drawSurface(m, depth) {
    const { context, frames, view } = this, { faces, face_offset } = frames.arrays, at = frames.position;
    const rgb = mix(this._colour(m), this.theme.canvas.rgb, this._fog(depth) * 0.07), seen = [];
    for (let f = face_offset[m]; f < face_offset[m + 1]; f++) {
      const [a, b, c] = [0, 1, 2].map(k => { const p = 3 * faces[3 * f + k]; return view.project(at[p], at[p + 1], at[p + 2]); });
      const [ux, uy, uz] = [b[0] - a[0], a[1] - b[1], (b[2] - a[2]) * view.scale], [vx, vy, vz] = [c[0] - a[0], a[1] - c[1], (c[2] - a[2]) * view.scale];
      const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], length = Math.hypot(nx, ny, nz);
      if (!(nz > 0)) continue;
      seen.push([a[2] + b[2] + c[2], a, b, c, Math.max(0, (-0.45 * nx + 0.5 * ny + 0.74 * nz) / length)]);
    }
    seen.sort((p, q) => p[0] - q[0]);
    context.lineWidth = 0.6;
    for (const [, a, b, c, light] of seen) {
      const colour = css(light < 0.8 ? mix(rgb, [0, 0, 0], 0.55 * (1 - light / 0.8)) : mix(rgb, [255, 255, 255], 1.2 * (light - 0.8)));
      context.fillStyle = context.strokeStyle = colour;
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.lineTo(c[0], c[1]);
      context.closePath();
      context.fill();
      context.stroke();
    }
  }

  /** Numbers of the particles to draw, the hindmost first. */
  _fromBehind() {
    const { frames, view } = this, keys = [];
    for (let m = 0; m < frames.particles; m++) {
      if (!frames.shown[m]) continue;
      const c = 3 * m, [, , depth, front] = view.project(frames.centre[c], frames.centre[c + 1], frames.centre[c + 2]);
      if (!(this.cut && front > 0)) keys.push([depth, m]);
    }
    keys.sort((a, b) => a[0] - b[0]);
    return keys.map(key => key[1]);
  }

  /** 0 to 5: how pale a particle is, the more the farther it is. */
  _fog(depth) {
    const { box } = this.view;
    return Math.max(0, Math.min(5, Math.round(5 * (0.5 - depth / (box.x1 - box.x0)))));
  }

  /** Picture of a shaded sphere. */
  _sprite(m, depth) {
    const fog = this._fog(depth);
    const value = this.quantity ? this.frames.value(this.quantity, m) : NaN, index = Number.isNaN(value) ? -1 : this.scale.index(value);
    const key = index * 8 + fog;
    if (!this._sprites.has(key)) this._sprites.set(key, sphere(mix(this._colour(m), this.theme.canvas.rgb, fog * 0.07)));
    return this._sprites.get(key);
  }

  /** Walls of revolution: circles at the ends of the meridian, and meridians of the half behind or in front of the axis. */
  _drawShell(front) {
    const { context, view, frames } = this, walls = frames.walls, parts = 48;
    context.strokeStyle = this.theme.wall.text;
    const rings = new Map();
    for (let i = 0; i < walls.length; i += 4)
      for (const [rho, z] of [[walls[i], walls[i + 1]], [walls[i + 2], walls[i + 3]]]) if (rho > 0) rings.set(`${rho} ${z}`, [rho, z]);
    const path = (from, to) => {
      const [a, b] = [view.project(...from), view.project(...to)];
      if ((a[3] + b[3] > 0) !== front) return;
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
    };
    const place = (rho, z, turn) => [rho * Math.cos(turn), rho * Math.sin(turn), z];
    context.globalAlpha = front ? 0.35 : 0.9;
    context.lineWidth = 1.6;
    context.beginPath();
    for (const [rho, z] of rings.values())
      for (let k = 0; k < parts; k++) path(place(rho, z, 2 * Math.PI * k / parts), place(rho, z, 2 * Math.PI * (k + 1) / parts));
    context.stroke();
    context.globalAlpha = front ? 0.18 : 0.4;
    context.lineWidth = 1;
    context.beginPath();
    for (let i = 0; i < walls.length; i += 4) {
      if (!(walls[i] >= 0 && walls[i + 2] >= 0)) continue;
      for (let k = 0; k < 24; k++) path(place(walls[i], walls[i + 1], Math.PI * k / 12), place(walls[i + 2], walls[i + 3], Math.PI * k / 12));
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  // ---- pointer ----------------------------------------------------------------------------------------------------------

  /** The particle under a point of the canvas, the foremost one; −1 if there is none. */
  particleAt(px, py) {
    const { frames, view } = this, D = frames.dim;
    let found = -1, best = -Infinity;
    view.turn();
    for (let m = 0; m < frames.particles; m++) {
      if (!frames.shown[m]) continue;
      const [x, y, depth, front] = view.project(...frames.centreOf(m)), radius = frames.arrays.diameter[m] / 2 * view.scale;
      const distance = Math.hypot(px - x, py - y);
      if (distance > radius || (D === 3 && this.cut && front > 0)) continue;
      const rank = D === 3 ? depth : -distance;
      if (rank > best) [best, found] = [rank, m];
    }
    return found;
  }
}

/** A sphere lit from the upper left. */
function sphere(rgb, size = 56) {
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d"), r = size / 2;
  canvas.width = canvas.height = size;
  const light = context.createRadialGradient(0.68 * r, 0.62 * r, 0.05 * r, r, r, r);
  light.addColorStop(0, css(mix(rgb, [255, 255, 255], 0.55)));
  light.addColorStop(0.35, css(rgb));
  light.addColorStop(1, css(mix(rgb, [0, 0, 0], 0.5)));
  context.fillStyle = light;
  context.beginPath();
  context.arc(r, r, r - 0.5, 0, 2 * Math.PI);
  context.fill();
  return canvas;
}
