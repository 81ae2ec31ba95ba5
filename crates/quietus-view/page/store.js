// The picture as it came: for each layer the tiles of 8x8 pixels one after the other, as the render lays them out.

export const TILE = 8, TILE_PIXELS = 64;

// Channels of each layer, and the array that holds them.
const FORMATS = {
  beauty: [4, Uint16Array],
  samples: [1, Uint32Array],
  error: [1, Float32Array],
  active: [1 / 32, Uint32Array],
  albedo: [3, Uint16Array],
  normal: [3, Uint16Array],
  depth: [1, Float32Array],
};

export class Store {
  /** For the `window` [x0, y0, x1, y1] of a frame. */
  constructor(window) {
    this.window = window;
    this.width = window[2] - window[0];
    this.height = window[3] - window[1];
    this.across = Math.ceil(this.width / TILE);
    this.down = Math.ceil(this.height / TILE);
    this.tiles = this.across * this.down;
    this.layers = {};
  }

  /** The layer's values, and which of its tiles have come. */
  layer(name) {
    const [channels, Values] = FORMATS[name];
    return (this.layers[name] ??= {
      channels,
      values: new Values(this.tiles * TILE_PIXELS * channels),
      here: new Uint8Array(this.tiles),
    });
  }

  /** Takes tiles as they come from the render. */
  take({ layer: name, indices, buffer, offset }) {
    const layer = this.layer(name);
    const length = TILE_PIXELS * layer.channels;
    const values = new layer.values.constructor(buffer, offset);
    indices.forEach((tile, i) => {
      layer.values.set(values.subarray(i * length, (i + 1) * length), tile * length);
      layer.here[tile] = 1;
    });
  }

  /** Where the pixel (x, y) of the window lies among the pixels of all tiles. */
  place(x, y) {
    const tile = (y >> 3) * this.across + (x >> 3);
    return tile * TILE_PIXELS + (y & 7) * TILE + (x & 7);
  }

  /** A copy that stays as it is. */
  frozen() {
    const copy = new Store(this.window);
    for (const [name, { channels, values, here }] of Object.entries(this.layers)) {
      copy.layers[name] = { channels, values: values.slice(), here: here.slice() };
    }
    return copy;
  }

  /** A picture of half floats, row by row over the whole frame, as a store of this one's window. */
  static ofPicture(window, frame, halves) {
    const store = new Store(window), layer = store.layer("beauty");
    layer.here.fill(1);
    for (let y = 0; y < store.height; y++) {
      const row = (y + window[1]) * frame[0] + window[0];
      for (let x = 0; x < store.width; x++) {
        const from = 4 * (row + x);
        layer.values.set(halves.subarray(from, from + 4), 4 * store.place(x, y));
      }
    }
    return store;
  }
}
