// The legend: what the colours of an overlay mean, in real units.

import { mapTable } from "./maps.js";
import { number } from "./words.js";

const UNITS = {
  samples: "samples per pixel",
  error: "remaining error: |I − A| / √I over both halves (Dammertz et al. 2010)",
  depth: "distance along the view, in units of the scene",
};

const KEYS = {
  active: [["rgb(245 167 66)", "sampling goes on"], ["rgb(60 60 60)", "done"]],
  normal: [["rgb(255 128 128)", "+x"], ["rgb(128 255 128)", "+y"], ["rgb(128 128 255)", "+z"]],
  albedo: [],
  tree: [["rgb(245 150 40)", "active leaf"], ["rgb(110 180 255)", "complete leaf"]],
};

const NAMES = {
  active: "Where sampling goes on", normal: "Normal in the world", albedo: "Albedo, from 0 to 1 (sRGB)",
};

const id = (name) => document.getElementById(name);

/** Shows the legend of `look` with the numbers' `range`. */
export function showLegend({ layer, map }, range, showsTree) {
  const isNumber = layer in UNITS, keys = [...(KEYS[layer] ?? []), ...(showsTree ? KEYS.tree : [])];
  id("legend").hidden = layer === "beauty" && !showsTree;
  id("legend-name").textContent = UNITS[layer] ?? NAMES[layer] ?? "";
  id("legend-scale").hidden = !isNumber;
  if (isNumber) {
    id("legend-low").textContent = number(range.low);
    id("legend-high").textContent = number(range.high) + (range.isLog ? " (logarithmic)" : "");
    const image = new ImageData(256, 1);
    new Uint32Array(image.data.buffer).set(mapTable(map));
    id("legend-bar").getContext("2d").putImageData(image, 0, 0);
  }
  id("legend-keys").replaceChildren(...keys.map(([color, name]) => {
    const item = document.createElement("li"), swatch = document.createElement("span");
    swatch.className = "swatch";
    // Through the object model: the page's policy lets no style attribute in.
    swatch.style.background = color;
    item.append(swatch, name);
    return item;
  }));
}
