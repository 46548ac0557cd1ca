/* The decoded frames: positions, quantities and forces of each in the units of the run. */
"use strict";

class Frames {
  constructor(data, arrays) {
    Object.assign(this, { data, arrays, dim: data.dim, count: data.times.length });
    this.particles = arrays.diameter.length;
    this.points = data.entries.positions.shape[1];
    this.deformable = "offset" in arrays;
    this.surfaces = "faces" in arrays;
    this.step = data.high.map((high, d) => (high - data.low[d]) / data.levels);
    this.quantities = data.quantities.map(q => this._withRange(q));
    this._position = new Float32Array(this.points * this.dim);
    this._centre = new Float32Array(this.particles * this.dim);
    this._prepareForces();
    this.load(0);
  }

  /** Prepares positions, centres and `shown` of a frame. */
  load(index) {
    this.index = index;
    const { positions, shown } = this.arrays, D = this.dim, from = index * this.points * D;
    for (let i = 0; i < this._position.length; i++) this._position[i] = this.data.low[i % D] + positions[from + i] * this.step[i % D];
    const bytes = Math.ceil(this.particles / 8);
    this.shown = Uint8Array.from({ length: this.particles }, (_, m) => shown[index * bytes + (m >> 3)] >> (7 - (m & 7)) & 1);
    if (!this.deformable) this._centre.set(this._position);
    else this._averageVertices();
  }

  _averageVertices() {
    const { offset } = this.arrays, D = this.dim;
    for (let m = 0; m < this.particles; m++)
      for (let d = 0; d < D; d++) {
        let sum = 0;
        for (let p = offset[m]; p < offset[m + 1]; p++) sum += this._position[p * D + d];
        this._centre[m * D + d] = sum / (offset[m + 1] - offset[m]);
      }
  }

  get time() { return this.data.times[this.index]; }
  get position() { return this._position; }
  get centre() { return this._centre; }

  angle(m) {
    const { angles } = this.arrays;
    return angles ? angles[this.index * this.particles + m] / this.data.levels * 2 * Math.PI : null;
  }

  /** Value of a quantity of particle m in the loaded frame; NaN if it is not known. */
  value(quantity, m) {
    if (quantity.name === "size") return this.arrays.diameter[m];
    if (quantity.name === "id") return m;
    if (quantity.name === "start") return this._start[m];
    const level = this.arrays[quantity.name][this.index * this.particles + m];
    return level > this.data.value_levels ? NaN : quantity.least + level / this.data.value_levels * (quantity.most - quantity.least);
  }

  /** The quantity with the range of its colours, which static ones get here. */
  _withRange(quantity) {
    if (quantity.range) return quantity;
    if (quantity.name === "start") {
      const D = this.dim, { positions, offset } = this.arrays;
      this._start = Float32Array.from({ length: this.particles }, (_, m) => {
        const point = this.deformable ? offset[m] : m;
        return this.data.low[D - 1] + positions[point * D + D - 1] * this.step[D - 1];
      });
      return { ...quantity, range: [Math.min(...sample(this._start)), Math.max(...sample(this._start))] };
    }
    if (quantity.name === "size") return { ...quantity, range: spread(this.arrays.diameter) };
    return { ...quantity, range: [0, this.particles] };
  }

  // ---- forces ---------------------------------------------------------------------------------------------------------

  _prepareForces() {
    this.hasForces = this.data.largest_force !== null;
    if (!this.hasForces) return;
    const counts = this.arrays.force_counts;
    this._firstPair = new Uint32Array(this.count + 1);
    this._firstContact = new Uint32Array(this.count + 1);
    for (let f = 0; f < this.count; f++) {
      this._firstPair[f + 1] = this._firstPair[f] + counts[2 * f];
      this._firstContact[f + 1] = this._firstContact[f] + counts[2 * f + 1];
    }
    const sizes = sample(this.arrays.pairs_force).map(level => Math.abs(this._force(level))).filter(f => f > 0).sort((a, b) => a - b);
    this.strong = sizes.length ? sizes[Math.floor(0.99 * (sizes.length - 1))] : this.data.largest_force || 1;
  }

  _force(level) {
    return (2 * level / this.data.levels - 1) * this.data.largest_force;
  }

  /** Calls draw(start, end, force) of each line of the force network; start and end are arrays of coordinates. Negative: attraction. */
  eachForce(draw) {
    const { pairs_first, pairs_second, pairs_force, contacts_first, contacts_place, contacts_force } = this.arrays, D = this.dim;
    for (let c = this._firstPair[this.index]; c < this._firstPair[this.index + 1]; c++) {
      const start = this.centreOf(pairs_first[c]), end = this.centreOf(pairs_second[c]);
      draw(start, this._nearestImage(start, end), this._force(pairs_force[c]));
    }
    for (let c = this._firstContact[this.index]; c < this._firstContact[this.index + 1]; c++) {
      const place = Array.from({ length: D }, (_, d) => this.data.low[d] + contacts_place[c * D + d] * this.step[d]);
      draw(this.centreOf(contacts_first[c]), place, this._force(contacts_force[c]));
    }
  }

  centreOf(m) {
    return Array.from(this._centre.subarray(m * this.dim, (m + 1) * this.dim));
  }

  _nearestImage(start, end) {
    if (!this.data.box) return end;
    return end.map((x, d) => {
      const period = this.data.box[1][d];
      return period === null ? x : x - period * Math.round((x - start[d]) / period);
    });
  }

  /** [x1, y1, x2, y2, …] of the walls in the loaded frame. */
  get walls() {
    const [frames, count] = this.data.entries.walls.shape;
    return this.arrays.walls.subarray(frames > 1 ? this.index * count * 4 : 0, (frames > 1 ? this.index + 1 : 1) * count * 4);
  }
}

/** At most 20000 values, spread over an array. */
function sample(values) {
  const step = Math.ceil(values.length / 20000) || 1;
  return Array.from({ length: Math.floor(values.length / step) }, (_, i) => values[i * step]);
}

function spread(values) {
  const some = sample(values), low = Math.min(...some), high = Math.max(...some);
  return high > low ? [low, high] : [low - 0.5, low + 0.5];
}
