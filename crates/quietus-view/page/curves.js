// Curves over time, as drawings with their latest value in words.

import { large, number, percent, time } from "./words.js";

const WIDTH = 300, HEIGHT = 60;

// What is drawn: the moments' field, perhaps a second one with what was asked for, and how values are said.
const CURVES = [
  { title: "Converged share", field: "converged", say: percent, least: 0, most: 1 },
  { title: "Noise, % of white", field: "noise", asked: "noise_asked", say: number, least: 0 },
  { title: "Samples per second", field: "rate", say: large, least: 0 },
  { title: "Slowest rebuild, ms", field: "rebuild_ms", say: number, least: 0 },
];

export class Curves {
  constructor(box) {
    this.drawings = CURVES.map((curve) => {
      const figure = document.createElement("figure");
      figure.innerHTML = `<figcaption><span></span><b>–</b></figcaption>
        <svg viewBox="0 0 ${WIDTH} ${HEIGHT}" preserveAspectRatio="none" role="img"><path class="asked"></path>
        <path class="now"></path></svg><div class="ends"><span></span><span></span></div>`;
      figure.querySelector("span").textContent = curve.title;
      figure.hidden = true;
      box.append(figure);
      return { ...curve, figure };
    });
    this.moments = [];
  }

  set(moments) {
    this.moments = moments;
    this.draw();
  }

  add(moment) {
    this.moments.push(moment);
    // As the render does: every other one goes.
    if (this.moments.length > 1200) this.moments = this.moments.filter((_, i) => i % 2 === 0);
    this.draw();
  }

  draw() {
    for (const drawing of this.drawings) draw(drawing, this.moments);
  }
}

function draw({ title, field, asked, say, least, most, figure }, moments) {
  const of = (name) => moments.filter((m) => m[name] !== null && m[name] !== undefined);
  const points = of(field), wishes = asked ? of(asked) : [];
  figure.hidden = points.length + wishes.length === 0;
  if (figure.hidden) return;
  const end = Math.max(moments.at(-1).seconds, 1e-9);
  const top = most ?? Math.max(1e-12, ...points.map((m) => m[field]), ...wishes.map((m) => m[asked]));
  const path = (list, name) => list.map((m, i) => {
    const x = (m.seconds / end) * WIDTH, y = HEIGHT - 2 - ((m[name] - least) / (top - least)) * (HEIGHT - 4);
    return `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
  }).join("");
  figure.querySelector(".now").setAttribute("d", path(points, field));
  figure.querySelector(".asked").setAttribute("d", path(wishes, asked));
  let words = points.length ? say(points.at(-1)[field]) : "–";
  if (wishes.length) words += ` (asked: ${say(wishes.at(-1)[asked])})`;
  figure.querySelector("b").textContent = words;
  figure.querySelector("svg").setAttribute("aria-label", `${title} over ${time(end)}, now ${words}, at most ${say(top)}`);
  const [low, high] = figure.querySelectorAll(".ends span");
  low.textContent = `0 to ${say(top)}`;
  high.textContent = `over ${time(end)}`;
}
