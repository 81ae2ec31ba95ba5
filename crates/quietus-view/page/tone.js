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

// AgX: Troy Sobotka's display transform (2022), in the form of a fit by Benjamin Wrensch (2023): linear Rec.709 into a
// wider space, a logarithm over its range of stops, a polynomial for the contrast, and back out of that space.
const INSET = [
  [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
  [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
  [0.0423756549057051, 0.0784336, 0.879142973793104],
];
const OUTSET = [
  [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
  [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
  [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
];
const LEAST_STOP = -12.47393, MOST_STOP = 4.026069;
const CONTRAST = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];

/** The curve of AgX on one channel of its space. */
function contrast(value) {
  const x = unit((Math.log2(Math.max(value, 1e-30)) - LEAST_STOP) / (MOST_STOP - LEAST_STOP));
  return CONTRAST.reduceRight((sum, factor) => sum * x + factor, 0);
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
