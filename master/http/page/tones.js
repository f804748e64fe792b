// Pixels of tiles as numbers in linear light, and as colors of the screen.

// Display value of a linear one, by a table: sRGB.
const kSteps = 8192;
const kSrgb = new Uint8Array(kSteps + 1);
for (let i = 0; i <= kSteps; ++i) {
  const v = (i / kSteps) ** 2;
  kSrgb[i] = Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
}

// Every half float.
const kHalf = new Float32Array(65536);
for (let i = 0; i < 65536; ++i) {
  const exponent = (i >> 10) & 31, mantissa = i & 1023, sign = i & 0x8000 ? -1 : 1;
  kHalf[i] = sign * (exponent === 31 ? (mantissa ? NaN : Infinity) : exponent ? (1024 + mantissa) * 2 ** (exponent - 25) : mantissa * 2 ** -24);
}

// `form`: rgbe or half; `layers`: of a mix, else 1. Null: the bytes are no tile of so many pixels.
export function tileOf(buffer, form, pixels, layers) {
  if (buffer.byteLength !== (form === 'half' ? 6 * layers : 4) * pixels) return null;
  return {form, pixels, layers, data: form === 'half' ? new Uint16Array(buffer) : new Uint8Array(buffer)};
}

// Three numbers a pixel, from pixel `begin` on. `weights`: [red, green, blue] of each layer of a mix; null: there is one layer,
// as it is.
export function linear(tile, weights, begin = 0, count = tile.pixels) {
  const out = new Float32Array(3 * count), {data} = tile;
  if (tile.form === 'rgbe') {
    for (let i = 0; i < count; ++i) {
      const at = 4 * (begin + i), scale = data[at + 3] ? 2 ** (data[at + 3] - 136) : 0;
      for (let c = 0; c < 3; ++c) out[3 * i + c] = data[at + c] * scale;
    }
    return out;
  }
  for (let layer = 0; layer < tile.layers; ++layer) {
    const [r, g, b] = weights ? weights[layer] : [1, 1, 1];
    if (!r && !g && !b) continue;
    const from = 3 * (layer * tile.pixels + begin);
    for (let i = 0; i < 3 * count; i += 3) {
      out[i] += r * kHalf[data[from + i]];
      out[i + 1] += g * kHalf[data[from + i + 1]];
      out[i + 2] += b * kHalf[data[from + i + 2]];
    }
  }
  return out;
}

// Writes bytes of red, green, blue and alpha.
export function tone(values, gain, out) {
  for (let i = 0, k = 0; i < values.length; i += 3, k += 4) {
    for (let c = 0; c < 3; ++c) out[k + c] = kSrgb[Math.round(kSteps * Math.sqrt(Math.min(1, Math.max(0, values[i + c] * gain))))];
    out[k + 3] = 255;
  }
}

// The number of a pixel, by the name that requests of colors give it.
const kNumbers = {
  luminance: (r, g, b) => 0.2126 * r + 0.7152 * g + 0.0722 * b,
  length: (x, y, z) => Math.hypot(x, y, z),
};
export function numberOf(channel, letters) {
  const at = Math.max(0, letters.indexOf(channel));
  return kNumbers[channel] ?? ((...v) => v[at]);
}
// The numbers that a picture of these letters has, the usual one first.
export const channelsOf = (letters) => (letters === 'RGB' ? ['luminance', 'R', 'G', 'B'] : letters.length > 1 ? ['length', ...letters] : [letters]);

const bytesOf = (hex) => Uint8Array.from(hex.match(/../g) ?? [], (pair) => parseInt(pair, 16));
// The master's answer about colors, ready for colorize().
export function colorsOf(answer, logarithmic) {
  return {...answer, logarithmic, map: bytesOf(answer.colors), none: bytesOf(answer.not_finite_color), below: bytesOf(answer.zero_or_less_color)};
}
// Place of a number on the scale: 0 at its low end, 1 at its high end.
export function placeOf(v, {low, high, logarithmic}) {
  return logarithmic ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low);
}
export function colorize(values, number, colors, out) {
  const {map, none, below, logarithmic} = colors, last = map.length / 3 - 1;
  for (let i = 0, k = 0; i < values.length; i += 3, k += 4) {
    const v = number(values[i], values[i + 1], values[i + 2]);
    let from = map, at = 0;
    if (!Number.isFinite(v)) from = none;
    else if (logarithmic && v <= 0) from = below;
    else at = 3 * Math.round(last * Math.min(1, Math.max(0, placeOf(v, colors))));
    for (let c = 0; c < 3; ++c) out[k + c] = from[at + c];
    out[k + 3] = 255;
  }
}

// The curve of sRGB, both ways, for numbers in [0, 1].
export const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
export const toSrgb = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
