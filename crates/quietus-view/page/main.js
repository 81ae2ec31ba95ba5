// The page of the live view: what comes from the render, what is on the screen, and what the controls do.

import { connect } from "./link.js";
import { Store } from "./store.js";
import { Surface } from "./surface.js";
import { Stage } from "./stage.js";
import { Hands } from "./hands.js";
import { Curves } from "./curves.js";
import { showLegend } from "./legend.js";
import { HALVES } from "./tone.js";
import { large, number, percent, time, timeLeft } from "./words.js";

const id = (name) => document.getElementById(name);
const look = { layer: "beauty", stops: 0, tone: "srgb", map: "viridis" };
const state = { session: null, render: "", store: null, now: null, kept: null, reference: null, said: "", taken: 0 };

const stage = new Stage(id("stage"), valuesAt);
const curves = new Curves(id("curves"));
const hands = new Hands(stage, { moved, cropped, pointed, wiped });
const link = connect({ open, lost, session, status, history, pixel, notice, tiles, coarse, tree });

// --- what comes from the render ---

function open() {
  say("Connected.");
  askForLayers();
}

function lost() {
  const hasEnded = state.render === "finished" || state.render === "stopped";
  say(hasEnded ? "The render has ended." : "The render cannot be reached; trying again …");
  state.render = "";
  showControls();
}

function session(message) {
  state.session = message;
  state.store = new Store(message.window);
  state.now = stage.now = new Surface(state.store, look);
  state.kept = state.reference = stage.tree = null;
  state.taken = 0;
  // What was coarse is below the tiles now, until they are there.
  stage.isCoarse = false;
  stage.origin = message.window;
  stage.setSize(state.store.width, state.store.height);
  id("title").textContent = message.title;
  document.title = `${message.title} – Quietus`;
  message.window.forEach((side, i) => { id(["crop-x0", "crop-y0", "crop-x1", "crop-y1"][i]).value = side; });
  id("stage").setAttribute("aria-label", `The picture, ${state.store.width} by ${state.store.height} pixels`);
  const reference = id("compare").querySelector('[value="reference"]');
  reference.disabled = !message.reference;
  id("compare").querySelector('[value="earlier"]').disabled = true;
  if (id("compare").value === "earlier") id("compare").value = "";
  id("tree").disabled = !message.has_tree;
  compare();
  askForLayers();
  showControls();
}

function status(message) {
  curves.add(message);
  id("converged").textContent = percent(message.converged);
  id("spp").textContent = number(message.spp);
  id("rate").textContent = large(message.rate);
  id("elapsed").textContent = time(message.seconds);
  id("remaining").textContent = message.state === "rendering" ? timeLeft(message) : "–";
  if (message.noise_asked && document.activeElement !== id("noise")) id("noise").value = message.noise_asked;
  if (message.state !== state.render) {
    state.render = message.state;
    showControls();
  }
  // Said once per quarter, for those who listen.
  const quarter = Math.floor(4 * message.converged) * 25;
  const words = { rendering: quarter ? `Rendering, over ${quarter} % converged` : "Rendering", paused: "Paused", finished: "Finished",
    stopped: "Stopped" };
  say(words[message.state]);
}

function history({ moments }) {
  curves.set(moments);
}

function tiles(message) {
  state.taken++;
  if (message.session !== state.session?.number) return;
  state.store.take(message);
  if (message.layer === look.layer || message.layer === "beauty") state.now.add(message.indices);
}

function coarse({ session: number, window, width, height, halves }) {
  if (number !== state.session?.number) return;
  const picture = new Store([0, 0, width, height]);
  const surface = new Surface(Store.ofPicture(picture.window, [width, height], halves), { ...look, layer: "beauty" });
  while (surface.isBusy) surface.paint();
  stage.coarse = { canvas: surface.canvas, window };
  stage.isCoarse = stage.changed = true;
}

function tree(message) {
  if (message.session !== state.session?.number) return;
  stage.tree = message;
  stage.changed = true;
}

function notice({ text, wrong }) {
  const item = document.createElement("li");
  item.textContent = text;
  item.className = wrong ? "wrong" : "";
  id("notices").prepend(item);
  while (id("notices").children.length > 20) id("notices").lastChild.remove();
}

function pixel(p) {
  id("pixel").textContent = [
    `(${p.x}, ${p.y})${p.active ? ", sampling goes on" : ""}`,
    `linear ${p.color.slice(0, 3).map(number).join(" ")}, alpha ${number(p.color[3])}`,
    `${p.samples} samples, error ${number(p.error)}`,
    `albedo ${p.albedo.map(number).join(" ")}`,
    `normal ${p.normal.map(number).join(" ")}`,
    `depth ${p.depth ? number(p.depth) : "none"}`,
  ].join("\n");
}

// --- what is on the screen ---

function frame() {
  for (const surface of [state.now, stage.other]) {
    if (surface?.isBusy && surface.paint()) stage.changed = true;
  }
  if (stage.changed) stage.draw();
  // More is wanted when this is on the screen; a page that nobody sees wants nothing.
  for (; state.taken && !state.now?.isBusy; state.taken--) link.ask({ do: "ack" });
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);

setInterval(() => {
  if (state.now?.followRange()) updateLegend();
}, 1000);

function updateLegend() {
  showLegend(look, state.now?.range ?? { low: 0, high: 0 }, stage.showsTree);
}

/** After a change of the look. */
function repaint() {
  state.now?.repaint();
  stage.other?.repaint();
  updateLegend();
}

function valuesAt(x, y) {
  const { store } = state, at = store.place(x, y);
  if (look.layer === "active") return [];
  const { values, channels } = store.layer(look.layer);
  if (channels === 1) return [number(values[at])];
  return [0, 1, 2].map((i) => number(HALVES[values[channels * at + i]]));
}

function compare() {
  const choice = id("compare").value;
  const store = choice === "earlier" ? state.kept : choice === "reference" ? state.reference : null;
  if (choice === "reference" && !store) loadReference();
  stage.other = store && new Surface(store, lookAt(store));
  id("wipe-row").hidden = !store;
  stage.changed = true;
}

// The same look, but for layers that the store lacks: a reference, say, has a picture alone.
function lookAt({ layers }) {
  const get = (from, name) => (name === "layer" && !layers[from.layer] ? "beauty" : from[name]);
  return new Proxy(look, { get });
}

async function loadReference() {
  const { session: asked } = state, answer = await fetch("reference");
  if (!answer.ok || asked !== state.session) return;
  const halves = new Uint16Array(await answer.arrayBuffer());
  state.reference = Store.ofPicture(asked.window, asked.frame, halves);
  compare();
}

// --- what the controls do ---

function say(words) {
  if (words !== state.said) id("state").textContent = state.said = words;
}

function askForLayers() {
  const layers = look.layer === "beauty" ? [] : [look.layer];
  link?.ask({ do: "look", layers, tree: stage.showsTree });
}

function showControls() {
  const isOn = state.render === "rendering" || state.render === "paused", s = state.session;
  id("pause").disabled = !isOn;
  id("stop").disabled = !state.render;
  id("stop").textContent = isOn ? "Stop and save" : "Save again";
  id("pause").textContent = state.render === "paused" ? "Resume" : "Pause";
  const set = (ids, usable) => ids.forEach((name) => { id(name).disabled = !usable; });
  set(["noise"], state.render && s?.can_change_noise);
  set(["crop-mode", "whole", "camera-mode", "home"], state.render && s?.can_restart);
  id("noise-form").querySelector("button").disabled = id("noise").disabled;
  id("crop-form").querySelector("fieldset").disabled = id("whole").disabled;
}

function setMode(mode) {
  hands.setMode(mode);
  id("crop-mode").setAttribute("aria-pressed", mode === "crop");
  id("camera-mode").setAttribute("aria-pressed", mode === "camera");
  id("camera-help").hidden = mode !== "camera";
}

function toggleMode(mode) {
  setMode(hands.mode === mode ? "look" : mode);
  id("stage").focus({ preventScroll: true });
}

function setLayer(name) {
  id("layer").value = look.layer = name;
  askForLayers();
  repaint();
}

function setTree(shown) {
  id("tree").checked = stage.showsTree = shown;
  stage.changed = true;
  askForLayers();
  updateLegend();
}

function setExposure(stops) {
  look.stops = Math.max(-10, Math.min(10, stops));
  id("exposure").value = look.stops;
  id("exposure-value").textContent = look.stops.toFixed(1);
  repaint();
}

function keep() {
  if (!state.store) return;
  state.kept = state.store.frozen();
  id("compare").querySelector('[value="earlier"]').disabled = false;
  id("compare").value = "earlier";
  compare();
}

const togglePause = () => link.ask({ do: state.render === "paused" ? "resume" : "pause" });

function crop(window) {
  const [width, height] = state.session.frame, [x0, y0, x1, y1] = window;
  if (x0 < x1 && y0 < y1 && x1 <= width && y1 <= height) link.ask({ do: "crop", window });
  else notice({ text: `A crop has to lie within ${width} by ${height} pixels, left before right, top before bottom.`, wrong: true });
}

function cropped([x0, y0, x1, y1]) {
  const [left, top] = state.session.window;
  setMode("look");
  crop([x0 + left, y0 + top, x1 + left, y1 + top]);
}

// Moves are gathered, and sent with each picture of the screen.
let motion = null;
function moved(more) {
  if (!motion) {
    motion = { orbit: [0, 0], pan: [0, 0], dolly: 0 };
    requestAnimationFrame(() => {
      link.ask({ do: "move", ...motion });
      motion = null;
    });
  }
  for (const way of ["orbit", "pan"]) more[way].forEach((part, i) => { motion[way][i] += part; });
  motion.dolly += more.dolly;
}

let probed = "";
function pointed(place) {
  if (!place || !state.session) return;
  const [x, y] = [place[0] + state.session.window[0], place[1] + state.session.window[1]];
  const isInside = place[0] >= 0 && place[1] >= 0 && place[0] < state.store.width && place[1] < state.store.height;
  if (!isInside || `${x},${y}` === probed) return;
  probed = `${x},${y}`;
  link.ask({ do: "probe", x, y });
}

function wiped() {
  id("wipe").value = 100 * stage.wipe;
}

function wipeBy(way) {
  stage.wipe = Math.min(1, Math.max(0, stage.wipe + way));
  stage.changed = true;
  wiped();
}

function next(list, way) {
  const options = [...id(list).options].filter((option) => !option.disabled);
  const at = options.findIndex((option) => option.selected);
  return options[(at + way + options.length) % options.length].value;
}

function setTone(name) {
  id("tone").value = look.tone = name;
  repaint();
}

const on = (name, event, action) => id(name).addEventListener(event, action);
on("pause", "click", togglePause);
on("stop", "click", () => link.ask({ do: "stop" }));
on("noise-form", "submit", (e) => {
  e.preventDefault();
  link.ask({ do: "noise", percent: id("noise").valueAsNumber });
});
on("crop-form", "submit", (e) => {
  e.preventDefault();
  crop(["crop-x0", "crop-y0", "crop-x1", "crop-y1"].map((name) => id(name).valueAsNumber));
});
on("crop-mode", "click", () => toggleMode("crop"));
on("whole", "click", () => link.ask({ do: "whole" }));
on("camera-mode", "click", () => toggleMode("camera"));
on("home", "click", () => link.ask({ do: "home" }));
on("layer", "change", () => setLayer(id("layer").value));
on("tree", "change", () => setTree(id("tree").checked));
on("map", "change", () => { look.map = id("map").value; repaint(); });
on("exposure", "input", () => setExposure(id("exposure").valueAsNumber));
on("tone", "change", () => setTone(id("tone").value));
on("zoom-in", "click", () => stage.zoom(1.5));
on("zoom-out", "click", () => stage.zoom(1 / 1.5));
on("fit", "click", () => stage.fit());
on("one", "click", () => stage.zoom(1 / stage.view.zoom));
on("compare", "change", compare);
on("keep", "click", keep);
on("wipe", "input", () => { stage.wipe = id("wipe").valueAsNumber / 100; stage.changed = true; });

const KEYS = {
  " ": () => !id("pause").disabled && togglePause(),
  0: () => stage.fit(),
  1: () => stage.zoom(1 / stage.view.zoom),
  "[": () => setExposure(look.stops - 0.5),
  "]": () => setExposure(look.stops + 0.5),
  t: () => setTone(next("tone", 1)),
  l: () => setLayer(next("layer", 1)),
  L: () => setLayer(next("layer", -1)),
  r: () => !id("tree").disabled && setTree(!stage.showsTree),
  k: keep,
  ",": () => wipeBy(-0.02),
  ".": () => wipeBy(0.02),
  x: () => !id("crop-mode").disabled && toggleMode("crop"),
  c: () => !id("camera-mode").disabled && toggleMode("camera"),
  Escape: () => setMode("look"),
};
addEventListener("keydown", (event) => {
  // Fields and lists have keys of their own; buttons have the space bar.
  const isField = event.target.closest?.("input:not([type=checkbox]), select") && event.key !== "Escape";
  const isTaken = isField || (event.key === " " && event.target.closest?.("button, input, summary"));
  const action = isTaken || event.ctrlKey || event.altKey || event.metaKey ? null : KEYS[event.key];
  if (action) {
    event.preventDefault();
    action();
  }
});
showControls();
