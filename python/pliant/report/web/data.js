/* Decodes the data of the page: JSON, and compressed arrays of numbers. */
"use strict";

const ARRAYS = { float32: Float32Array, float64: Float64Array, uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array };

function readPage() {
  return JSON.parse(document.getElementById("data").textContent);
}

function fromBase64(text) {
  const characters = atob(text.trim()), bytes = new Uint8Array(characters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = characters.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Integers of [frames, …] from planes of bytes: all lowest bytes of a frame, then the next ones. */
function joinPlanes(bytes, entry) {
  const result = new ARRAYS[entry.type](entry.shape.reduce((a, b) => a * b, 1));
  const width = result.BYTES_PER_ELEMENT, frames = entry.shape[0], count = frames ? result.length / frames : 0;
  for (let f = 0; f < frames; f++)
    for (let byte = 0; byte < width; byte++) {
      const from = (f * width + byte) * count, shift = 8 * byte;
      for (let i = 0; i < count; i++) result[f * count + i] |= bytes[from + i] << shift;
    }
  return result;
}

/** Undoes differences along an axis; the integers wrap. */
function addUp(values, shape, axis) {
  const inner = shape.slice(axis + 1).reduce((a, b) => a * b, 1), block = inner * shape[axis];
  for (let start = 0; start < values.length; start += block)
    for (let i = start + inner; i < start + block; i++) values[i] += values[i - inner];
}

async function decodeArray(bytes, entry) {
  const plain = await inflate(bytes.subarray(entry.start, entry.start + entry.size));
  if (!entry.planes) return new ARRAYS[entry.type](plain.buffer);
  const values = joinPlanes(plain, entry);
  for (const axis of [...entry.delta].reverse()) addUp(values, entry.shape, axis);
  return values;
}

/** All arrays of the player by name. */
async function decodeFrames(entries) {
  if (typeof DecompressionStream === "undefined")
    throw new Error("This browser cannot decompress the frames. Use Firefox 113, Chrome 80, Safari 16.4 or a later version.");
  const bytes = fromBase64(document.getElementById("frames").textContent), arrays = {};
  for (const [name, entry] of Object.entries(entries)) arrays[name] = await decodeArray(bytes, entry);
  return arrays;
}
