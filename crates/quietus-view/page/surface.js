// A store as it looks: paints tiles into a canvas of the window's size, a few milliseconds of them at a time.

import { HALVES, toneCurve } from "./tone.js";
import { numberColors } from "./maps.js";
import { TILE, TILE_PIXELS } from "./store.js";

/** Time for painting between two pictures of the screen, in milliseconds. */
const PATIENCE = 10;

/** How much a range may move before everything is painted anew. */
const SLACK = 0.05;

const DIMMED = 0.35;
const ACTIVE_TINT = [245, 167, 66];

export class Surface {
  /** `look` is what is to be seen: { layer, stops, tone, map }, shared with others and changed from outside. */
  constructor(store, look) {
    this.store = store;
    this.look = look;
    this.canvas = new OffscreenCanvas(store.width, store.height);
    this.context = this.canvas.getContext("2d");
    this.image = new ImageData(store.width, store.height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.waiting = new Uint8Array(store.tiles);
    this.first = store.tiles;
    this.range = { low: 0, high: 0, isLog: false };
    this.repaint();
  }

  /** Everything, as the look changed. */
  repaint() {
    this.color = this.colors();
    this.waiting.set(this.store.layer("beauty").here);
    this.first = 0;
  }

  /** These tiles, as they came. */
  add(indices) {
    for (const tile of indices) {
      this.waiting[tile] = 1;
      if (tile < this.first) this.first = tile;
    }
  }

  /** Paints what waits, as far as there is time; says whether anything was. */
  paint() {
    const { across, tiles } = this.store, end = performance.now() + PATIENCE;
    let any = false;
    while (this.first < tiles) {
      const row = Math.floor(this.first / across) * across;
      let left = across, right = -1;
      for (let column = this.first - row; column < across; column++) {
        if (!this.waiting[row + column]) continue;
        this.waiting[row + column] = 0;
        this.paintTile(row + column);
        left = Math.min(left, column);
        right = column;
      }
      if (right >= 0) {
        const y = (row / across) * TILE;
        this.context.putImageData(this.image, 0, 0, left * TILE, y, (right + 1 - left) * TILE, TILE);
        any = true;
      }
      this.first = row + across;
      if (performance.now() > end) break;
    }
    return any;
  }

  get isBusy() {
    return this.first < this.store.tiles;
  }

  paintTile(tile) {
    const { across, width, height } = this.store;
    const x0 = (tile % across) * TILE, y0 = Math.floor(tile / across) * TILE;
    const columns = Math.min(TILE, width - x0), rows = Math.min(TILE, height - y0);
    for (let y = 0; y < rows; y++) {
      const from = tile * TILE_PIXELS + y * TILE, to = (y0 + y) * width + x0;
      for (let x = 0; x < columns; x++) this.pixels[to + x] = this.color(from + x);
    }
  }

  /** The function from a pixel's place in the store to its colour. */
  colors() {
    const { layer: name, stops, tone, map } = this.look;
    const { values, channels } = this.store.layer(name);
    if (name === "beauty") {
      const curve = toneCurve(tone, stops);
      return (at) => curve(values, at * channels);
    }
    if (name === "albedo") {
      const curve = toneCurve("srgb", 0);
      return (at) => curve(values, at * channels);
    }
    if (name === "normal") return normalColors(values);
    if (name === "active") return activeColors(values, this.store.layer("beauty").values, toneCurve(tone, stops));
    this.range = rangeOf(name, this.store);
    const color = numberColors(map, this.range);
    return (at) => color(values[at]);
  }

  /** Follows the numbers where they left the range that is shown. Says whether they did. */
  followRange() {
    const { layer } = this.look;
    if (!["samples", "error", "depth"].includes(layer)) return false;
    const { low, high } = rangeOf(layer, this.store);
    const far = (a, b) => Math.abs(a - b) > SLACK * Math.max(Math.abs(a), Math.abs(b));
    if (!far(low, this.range.low) && !far(high, this.range.high)) return false;
    this.repaint();
    return true;
  }
}

const byte = (v) => Math.max(0, Math.min(255, Math.round(255 * v)));

function normalColors(values) {
  return (at) => {
    const [r, g, b] = [0, 1, 2].map((i) => byte(0.5 + 0.5 * HALVES[values[3 * at + i]]));
    return 0xff000000 | (b << 16) | (g << 8) | r;
  };
}

/** The picture, dark where it is done, and tinted where sampling goes on. */
function activeColors(masks, colors, curve) {
  return (at) => {
    const color = curve(colors, 4 * at), isActive = (masks[at >> 5] >>> (at & 31)) & 1;
    let mixed = 0xff000000;
    for (let i = 0; i < 3; i++) {
      const dimmed = DIMMED * ((color >>> (8 * i)) & 255);
      const value = isActive ? dimmed + (1 - DIMMED) * ACTIVE_TINT[i] : dimmed;
      mixed |= Math.round(value) << (8 * i);
    }
    return mixed;
  };
}

/** Lowest and highest number of what is there; what is 0 was never met and is left out. */
function rangeOf(name, store) {
  const { values, here } = store.layer(name);
  let low = Infinity, high = 0;
  for (let tile = 0; tile < store.tiles; tile++) {
    if (!here[tile]) continue;
    for (let at = tile * TILE_PIXELS; at < (tile + 1) * TILE_PIXELS; at++) {
      const value = values[at];
      if (value > 0 && value < low) low = value;
      if (value > high && value < Infinity) high = value;
    }
  }
  const isLog = name !== "depth";
  if (!(high > 0)) return { low: 0, high: 0, isLog };
  // Errors span too many orders of magnitude: what is a thousandth of the largest is as good as done.
  return { low: name === "error" ? Math.max(low, high / 1000) : low, high, isLog };
}
