// From linear light to the screen: half floats, exposure, and the tone curves.

/** The value of every half float. */
export const HALVES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24);
});

/** IEC 61966-2-1, for values from 0 to 1. */
const srgb = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
// Not-a-number fails both comparisons and becomes 0.
const unit = (v) => (v >= 1 ? 1 : v > 0 ? v : 0);

const pack = (r, g, b) => 0xff000000 | (b << 16) | (g << 8) | r;

/** Curves that treat each channel alone: one look-up per channel. */
function separate(curve, exposure) {
  const table = Uint8Array.from(HALVES, (value) => Math.round(255 * curve(unit(value * exposure))));
  return (values, at) => pack(table[values[at]], table[values[at + 1]], table[values[at + 2]]);
}

// AgX (Troy Sobotka's display transform, 2022), as `ToneCurve::AgX` of quietus-film has it: linear Rec.709 into narrower
// primaries, a logarithm over its range of stops, a sigmoid, and back out of those primaries.
const INSET = [
  [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
  [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
  [0.0423756549057051, 0.0784336, 0.879142973793104],
];
const OUTSET = inverse(INSET);
/** Stops below and above middle grey that the curve spans, and the values a display is sent below and above grey. */
const STOPS = [10, 6.5], GREY = 0.18, HALF = 0.5;
/** Slope of the curve at middle grey, and how sharply it bends below and above it. */
const SLOPE = 2, BEND = [3, 3.25];

/** By cofactors. */
function inverse(m) {
  const minor = (r, c) => {
    const [a, b, d, e] = [(r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3];
    return m[a][d] * m[b][e] - m[a][e] * m[b][d];
  };
  const determinant = [0, 1, 2].reduce((sum, c) => sum + m[0][c] * minor(0, c), 0);
  return [0, 1, 2].map((r) => [0, 1, 2].map((c) => minor(c, r) / determinant));
}

/** The curve of AgX on one channel of its space: a hyperbolic sigmoid through black, middle grey and white. */
function contrast(value) {
  const range = STOPS[0] + STOPS[1], pivot = STOPS[0] / range;
  const x = unit((Math.log2(Math.max(value / GREY, 1e-10)) + STOPS[0]) / range);
  const isBelow = x < pivot, power = BEND[isBelow ? 0 : 1], reach = SLOPE * (isBelow ? pivot : 1 - pivot);
  const limit = (HALF ** -power - reach ** -power) ** (-1 / power), t = (SLOPE * Math.abs(x - pivot)) / limit;
  return HALF + ((isBelow ? -1 : 1) * limit * t) / (1 + t ** power) ** (1 / power);
}

// The curve for every float, by its first 16 bits after the sign: 8 binary digits are finer than the screen shows.
const bits = new Uint32Array(1), float = new Float32Array(bits.buffer);
let contrasts = null;
function contrastTable() {
  return (contrasts ??= Float32Array.from({ length: 65536 }, (_, i) => {
    bits[0] = (i << 15) | 0x4000;
    return contrast(float[0]);
  }));
}

function agx(exposure) {
  const table = contrastTable();
  const curve = (value) => {
    float[0] = value > 0 ? value : 0;
    return table[bits[0] >>> 15];
  };
  const out = ([a, b, c], x, y, z) => Math.round(255 * unit(a * x + b * y + c * z));
  const [r0, r1, r2] = INSET;
  return (values, at) => {
    const r = exposure * HALVES[values[at]], g = exposure * HALVES[values[at + 1]];
    const b = exposure * HALVES[values[at + 2]];
    const x = curve(r0[0] * r + r0[1] * g + r0[2] * b);
    const y = curve(r1[0] * r + r1[1] * g + r1[2] * b);
    const z = curve(r2[0] * r + r2[1] * g + r2[2] * b);
    return pack(out(OUTSET[0], x, y, z), out(OUTSET[1], x, y, z), out(OUTSET[2], x, y, z));
  };
}

/** A function from half floats `values[at..at + 3]` to a pixel of the screen. `stops` is the exposure. */
export function toneCurve(name, stops) {
  const exposure = 2 ** stops;
  if (name === "agx") return agx(exposure);
  return separate(name === "srgb" ? srgb : (v) => v, exposure);
}
