// Colours for numbers: maps that keep their order in grey and for the colour-blind, from few anchors.

// Viridis (Smith and van der Walt 2015) and cividis (Nuñez, Anderton and Renslow 2018) at even steps from 0 to 1;
// between anchors, straight lines.
const ANCHORS = {
  viridis: ["440154", "482878", "3e4989", "31688e", "26828e", "1f9e89", "35b779", "6ece58", "b5de2b", "fde725"],
  cividis: ["00224e", "123570", "3b496c", "575d6d", "707173", "8a8678", "a59c74", "c3b369", "e1cc55", "fee838"],
  grey: ["000000", "ffffff"],
};

const channels = (hex) => [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16));

function colorAt(anchors, t) {
  const place = t * (anchors.length - 1), i = Math.min(Math.floor(place), anchors.length - 2);
  const [low, high] = [channels(anchors[i]), channels(anchors[i + 1])];
  return low.map((c, k) => Math.round(c + (place - i) * (high[k] - c)));
}

const STEPS = 256;
const tables = {};

/** 256 pixels from the lowest to the highest colour. */
export function mapTable(name) {
  return (tables[name] ??= Uint32Array.from({ length: STEPS }, (_, i) => {
    const [r, g, b] = colorAt(ANCHORS[name], i / (STEPS - 1));
    return 0xff000000 | (b << 16) | (g << 8) | r;
  }));
}

/** A function from a number to a pixel: `low` to `high`, in equal ratios where `isLog`. */
export function numberColors(name, { low, high, isLog }) {
  const table = mapTable(name), scale = isLog ? Math.log2 : (v) => v;
  const from = scale(low), factor = high > low ? (STEPS - 1) / (scale(high) - from) : 0;
  return (value) => {
    const step = (scale(value) - from) * factor;
    // Not-a-number, as of a logarithm of less than 0, is the lowest.
    return table[step > STEPS - 1 ? STEPS - 1 : step > 0 ? step | 0 : 0];
  };
}
