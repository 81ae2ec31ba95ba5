// Hands on the stage: mouse, fingers and keys become pans, zooms, wipes, crops and moves of the camera.

const WHEEL = 0.0015, KEY_PAN = 40, KEY_ZOOM = 1.25, KEY_ORBIT = 0.03, KEY_DOLLY = 0.2;
/** How near to the wipe's line it is taken hold of, in CSS pixels. */
const GRIP = 12;

/** Modes: "look", "crop" and "camera". `on` has moved(motion), cropped(window), pointed(x, y), wiped(). */
export class Hands {
  constructor(stage, on) {
    this.stage = stage;
    this.on = on;
    this.mode = "look";
    this.pointers = new Map();
    this.drag = null;
    const { canvas } = stage;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => this.up(e));
    canvas.addEventListener("pointerleave", () => this.on.pointed(null));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
  }

  setMode(mode) {
    this.mode = mode;
    this.stage.crop = null;
    this.stage.changed = true;
    this.stage.canvas.classList.toggle("crosshair", mode === "crop");
  }

  down(event) {
    const { canvas } = this.stage, { offsetX: x, offsetY: y } = event;
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [x, y]);
    this.stage.showsCenter = false;
    const onWipe = this.stage.other && Math.abs(x - this.stage.wipeX) < GRIP && this.mode === "look";
    this.drag = this.pointers.size > 1 ? "pinch" : onWipe ? "wipe" : this.mode;
    this.start = this.stage.pixelAt(x, y);
  }

  move(event) {
    const { offsetX: x, offsetY: y } = event, before = this.pointers.get(event.pointerId);
    if (!before) return this.on.pointed(this.stage.pixelAt(x, y));
    const pinchBefore = this.pinch();
    this.pointers.set(event.pointerId, [x, y]);
    const [dx, dy] = [x - before[0], y - before[1]];
    if (this.drag === "pinch" && pinchBefore) this.pinched(pinchBefore, this.pinch());
    else if (this.drag === "wipe") this.wipeTo(x);
    else if (this.drag === "crop") this.dragCrop(x, y);
    else if (this.drag === "camera") this.moveCamera(dx, dy, event.shiftKey || event.buttons === 4);
    else if (this.drag === "look") this.stage.pan(dx, dy);
    this.on.pointed(this.stage.pixelAt(x, y));
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    if (this.drag === "crop" && this.stage.crop && event.type === "pointerup") this.on.cropped(this.stage.crop);
    if (this.pointers.size === 0) {
      this.drag = this.stage.crop = null;
      this.stage.changed = true;
    }
  }

  /** Middle and spread of two fingers. */
  pinch() {
    const [a, b] = this.pointers.values();
    return b && { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2, spread: Math.hypot(a[0] - b[0], a[1] - b[1]) || 1 };
  }

  pinched(before, now) {
    const factor = now.spread / before.spread, [dx, dy] = [now.x - before.x, now.y - before.y];
    if (this.mode === "camera") {
      this.moveCamera(dx, dy, true, Math.log2(factor));
    } else {
      this.stage.pan(dx, dy);
      this.stage.zoom(factor, now.x, now.y);
    }
  }

  wipeTo(x) {
    this.stage.wipe = Math.min(1, Math.max(0, x / this.stage.canvas.clientWidth));
    this.stage.changed = true;
    this.on.wiped();
  }

  dragCrop(x, y) {
    const [width, height] = this.stage.size, [sx, sy] = this.start, [ex, ey] = this.stage.pixelAt(x, y);
    const within = (v, most) => Math.min(most, Math.max(0, v));
    const crop = [
      within(Math.min(sx, ex), width), within(Math.min(sy, ey), height),
      within(Math.max(sx, ex) + 1, width), within(Math.max(sy, ey) + 1, height),
    ];
    this.stage.crop = crop[0] < crop[2] && crop[1] < crop[3] ? crop : null;
    this.stage.changed = true;
  }

  /** By so many CSS pixels, which become shares of the picture's height. */
  moveCamera(dx, dy, isPan, dolly = 0) {
    const height = this.stage.size[1] * this.stage.view.zoom, way = [dx / height, dy / height];
    this.on.moved({ orbit: isPan ? [0, 0] : way, pan: isPan ? way : [0, 0], dolly });
  }

  wheel(event) {
    event.preventDefault();
    // Lines and pages as some browsers count, in pixels.
    const way = -event.deltaY * [1, 16, 400][event.deltaMode];
    if (this.mode === "camera") this.on.moved({ orbit: [0, 0], pan: [0, 0], dolly: way * WHEEL });
    else this.stage.zoom(Math.exp(way * WHEEL), event.offsetX, event.offsetY);
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const arrow = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const nearer = { "+": 1, "=": 1, "-": -1, "_": -1 }[event.key];
    if (!arrow && !nearer) return;
    event.preventDefault();
    if (this.mode === "camera") {
      const way = arrow ? arrow.map((a) => -a * KEY_ORBIT) : [0, 0];
      const [orbit, pan] = event.shiftKey && arrow ? [[0, 0], way] : [way, [0, 0]];
      return this.on.moved({ orbit, pan, dolly: (nearer ?? 0) * KEY_DOLLY });
    }
    this.stage.showsCenter = true;
    if (arrow) this.stage.pan(...arrow.map((a) => a * KEY_PAN * (event.shiftKey ? 5 : 1)));
    else this.stage.zoom(KEY_ZOOM ** nearer);
    this.on.pointed(this.stage.center);
  }
}
