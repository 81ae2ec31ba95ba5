// What is on the screen: the picture at some place and size, the one it is compared with, and what is drawn over them.

const BACKGROUND = "#0b0c0e";
const LEAST_ZOOM = 1 / 32, MOST_ZOOM = 128;
/** From this zoom on a pixel has room for its values. */
const VALUES_ZOOM = 56;

export class Stage {
  /** Draws on `canvas`; `valuesAt(x, y)` gives lines of text for a pixel. */
  constructor(canvas, valuesAt) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.valuesAt = valuesAt;
    this.view = { zoom: 1, x: 0, y: 0 }; // of the window's pixels, in CSS pixels
    this.isFitted = true;
    this.size = [0, 0];
    this.now = this.other = this.coarse = this.tree = this.crop = null;
    this.wipe = 0.5;
    this.origin = [0, 0];
    this.showsTree = this.showsCenter = this.isCoarse = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  resize() {
    const ratio = devicePixelRatio || 1, { clientWidth, clientHeight } = this.canvas;
    this.ratio = ratio;
    this.canvas.width = Math.max(1, Math.round(clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    if (this.isFitted) this.fit();
    this.draw();
  }

  /** Shows a picture of this size from now on. */
  setSize(width, height) {
    const isSame = this.size[0] === width && this.size[1] === height;
    this.size = [width, height];
    if (!isSame) this.fit();
  }

  fit() {
    const { clientWidth: w, clientHeight: h } = this.canvas, [width, height] = this.size;
    if (!width) return;
    this.setZoom(Math.min(w / width, h / height));
    this.view.x = (w - width * this.view.zoom) / 2;
    this.view.y = (h - height * this.view.zoom) / 2;
    this.isFitted = true;
    this.changed = true;
  }

  setZoom(zoom) {
    this.view.zoom = Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, zoom));
  }

  /** Zooms by `factor` with the point (x, y) of the screen staying where it is; its middle where none is given. */
  zoom(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const before = this.view.zoom;
    this.setZoom(before * factor);
    const share = this.view.zoom / before;
    this.view.x = x - (x - this.view.x) * share;
    this.view.y = y - (y - this.view.y) * share;
    this.moved();
  }

  pan(dx, dy) {
    this.view.x += dx;
    this.view.y += dy;
    this.moved();
  }

  moved() {
    // Some of the picture stays in sight.
    const { clientWidth: w, clientHeight: h } = this.canvas, { zoom } = this.view, margin = 40;
    const [width, height] = this.size;
    this.view.x = Math.min(w - margin, Math.max(margin - width * zoom, this.view.x));
    this.view.y = Math.min(h - margin, Math.max(margin - height * zoom, this.view.y));
    this.isFitted = false;
    this.changed = true;
  }

  /** The window's pixel under a point of the screen, perhaps outside of the window. */
  pixelAt(x, y) {
    const { zoom, x: left, y: top } = this.view;
    return [Math.floor((x - left) / zoom), Math.floor((y - top) / zoom)];
  }

  get center() {
    return this.pixelAt(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
  }

  /** Where the wipe stands, in CSS pixels from the left. */
  get wipeX() {
    return this.wipe * this.canvas.clientWidth;
  }

  draw() {
    const { context: c, canvas, view } = this, ratio = this.ratio || 1;
    this.changed = false;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.fillStyle = BACKGROUND;
    c.fillRect(0, 0, canvas.width, canvas.height);
    if (!this.now) return;
    c.setTransform(ratio * view.zoom, 0, 0, ratio * view.zoom, ratio * view.x, ratio * view.y);
    c.imageSmoothingEnabled = ratio * view.zoom < 1;
    c.save();
    c.beginPath();
    c.rect(0, 0, ...this.size);
    c.clip();
    if (this.coarse) this.drawCoarse();
    if (!this.isCoarse) c.drawImage(this.now.canvas, 0, 0);
    if (this.other) this.drawOther();
    c.restore();
    if (this.showsTree && this.tree) this.drawTree();
    if (ratio * view.zoom >= VALUES_ZOOM) this.drawValues();
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (this.other) this.drawWipe();
    if (this.crop) this.drawCrop();
    if (this.showsCenter) this.drawCenter();
  }

  drawCoarse() {
    const [left, top] = this.origin, [x0, y0, x1, y1] = this.coarse.window;
    this.context.save();
    this.context.imageSmoothingEnabled = true;
    this.context.drawImage(this.coarse.canvas, x0 - left, y0 - top, x1 - x0, y1 - y0);
    this.context.restore();
  }

  drawOther() {
    const { context: c, view } = this, [width, height] = this.size;
    const from = (this.wipeX - view.x) / view.zoom;
    c.beginPath();
    c.rect(from, 0, Math.max(0, width - from), height);
    c.clip();
    c.drawImage(this.other.canvas, 0, 0);
  }

  drawWipe() {
    const { context: c, wipeX: x } = this, h = this.canvas.clientHeight;
    for (const [width, color] of [[4, "#000"], [2, "#fff"]]) {
      c.strokeStyle = color;
      c.lineWidth = width;
      c.beginPath();
      c.moveTo(x, 0);
      c.lineTo(x, h);
      c.stroke();
    }
  }

  /** Leaves: complete ones outlined in blue, active ones filled with orange. */
  drawTree() {
    const { context: c, view, canvas } = this, { complete, active, sides } = this.tree;
    const shown = ([x0, y0, x1, y1]) =>
      x1 * view.zoom + view.x > 0 && x0 * view.zoom + view.x < canvas.clientWidth &&
      y1 * view.zoom + view.y > 0 && y0 * view.zoom + view.y < canvas.clientHeight;
    c.lineWidth = 1 / view.zoom;
    const path = (from, to, least) => {
      c.beginPath();
      for (let i = from; i < to; i++) {
        const leaf = sides.subarray(4 * i, 4 * i + 4), [x0, y0, x1, y1] = leaf;
        // Outlines that would touch each other say nothing.
        if (shown(leaf) && (x1 - x0) * view.zoom >= least) c.rect(x0, y0, x1 - x0, y1 - y0);
      }
    };
    path(0, complete, 5);
    c.strokeStyle = "rgb(110 180 255 / 70%)";
    c.stroke();
    path(complete, complete + active, 0);
    c.fillStyle = "rgb(245 150 40 / 45%)";
    c.fill();
    path(complete, complete + active, 6);
    c.strokeStyle = "rgb(255 200 120 / 90%)";
    c.stroke();
  }

  /** The values of each pixel that is large enough, on it. */
  drawValues() {
    const { context: c, view, canvas, ratio } = this, [width, height] = this.size;
    const [x0, y0] = this.pixelAt(0, 0), [x1, y1] = this.pixelAt(canvas.clientWidth, canvas.clientHeight);
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.font = `${Math.min(13, view.zoom / 5.5)}px system-ui, sans-serif`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.lineWidth = 3;
    c.strokeStyle = "#000";
    c.fillStyle = "#fff";
    for (let y = Math.max(0, y0); y <= Math.min(height - 1, y1); y++) {
      for (let x = Math.max(0, x0); x <= Math.min(width - 1, x1); x++) {
        const lines = this.valuesAt(x, y), step = view.zoom / (lines.length + 1);
        lines.forEach((line, i) => {
          const place = [view.x + (x + 0.5) * view.zoom, view.y + y * view.zoom + (i + 1) * step];
          c.strokeText(line, ...place);
          c.fillText(line, ...place);
        });
      }
    }
  }

  drawCrop() {
    const { context: c, view } = this, [x0, y0, x1, y1] = this.crop;
    const sides = [x0 * view.zoom + view.x, y0 * view.zoom + view.y, (x1 - x0) * view.zoom, (y1 - y0) * view.zoom];
    c.lineWidth = 2;
    c.strokeStyle = "#000";
    c.setLineDash([]);
    c.strokeRect(...sides);
    c.strokeStyle = "#fff";
    c.setLineDash([6, 6]);
    c.strokeRect(...sides);
    c.setLineDash([]);
  }

  drawCenter() {
    const { context: c } = this, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2;
    for (const [width, color] of [[4, "#000"], [2, "#fff"]]) {
      c.strokeStyle = color;
      c.lineWidth = width;
      c.beginPath();
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        c.moveTo(x + 4 * dx, y + 4 * dy);
        c.lineTo(x + 11 * dx, y + 11 * dy);
      }
      c.stroke();
    }
  }
}
