/* Colour maps, from a few of their colours, and colours of numbers. */
"use strict";

const STOPS = {
  viridis: "440154 482475 414487 355f8d 2a788e 21918c 22a884 44bf70 7ad151 bddf26 fde725",
  cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
  magma: "000004 180f3d 440f76 721f81 9e2f7f cd4071 f1605d fd9668 feca8d fcfdbf",
  balance: "2166ac 4393c3 92c5de d1e5f0 f2f2f2 fddbc7 f4a582 d6604d b2182b",
};
const STEPS = 64;

function rgbOf(hex) {
  const value = parseInt(hex.replace("#", ""), 16);
  return [value >> 16, value >> 8 & 255, value & 255];
}

function mix(a, b, share) {
  return a.map((x, i) => Math.round(x + (b[i] - x) * share));
}

function css(rgb) {
  return `rgb(${rgb[0]},${rgb[1]},${rgb[2]})`;
}

/** STEPS colours [r, g, b] of a map between two places in 0 … 1. */
function colourMap(name, from = 0, to = 1) {
  const stops = STOPS[name].split(" ").map(rgbOf), colours = [];
  for (let i = 0; i < STEPS; i++) {
    const place = (from + (to - from) * i / (STEPS - 1)) * (stops.length - 1), k = Math.min(Math.floor(place), stops.length - 2);
    colours.push(mix(stops[k], stops[k + 1], place - k));
  }
  return colours;
}

/** Colours of particle numbers: hues that neighbours in number do not share. */
function idColours() {
  return Array.from({ length: STEPS }, (_, i) => {
    const hue = (i * 0.618034 % 1) * 6, light = [0.78, 0.62, 0.9][i % 3], c = light * 0.55, x = c * (1 - Math.abs(hue % 2 - 1));
    const rgb = [[c, x, 0], [x, c, 0], [0, c, x], [0, x, c], [x, 0, c], [c, 0, x]][Math.floor(hue) % 6];
    return rgb.map(v => Math.round(255 * (v + light - c)));
  });
}

const MAP_OF = { sequential: "viridis", counts: "viridis", diverging: "balance", sizes: "cividis" };

/** The colours of a quantity and the index of a value among them. */
class ColourScale {
  /** `dark`: the ground is dark, so that the darkest colours of a map are left out. */
  constructor(quantity, dark) {
    this.kind = quantity.kind;
    [this.low, this.high] = quantity.range;
    this.colours = this.kind === "ids" ? idColours() : colourMap(MAP_OF[this.kind], dark && this.kind !== "diverging" ? 0.14 : 0);
  }
  index(value) {
    if (this.kind === "ids") return value % STEPS;
    const place = (value - this.low) / (this.high - this.low || 1);
    return Math.max(0, Math.min(STEPS - 1, Math.round(place * (STEPS - 1))));
  }
  gradient() {
    return `linear-gradient(to right, ${this.colours.map(css).join(",")})`;
  }
}
