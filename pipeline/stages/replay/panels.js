// Diagrams of runs over time with one cursor, and their points of contact from above.
"use strict";

const SVG = "http://www.w3.org/2000/svg";
const INK = ["#1f4e8c", "#b4480f"];
const LOOKS = {
  plain: { "stroke-width": 2 }, thin: { "stroke-width": 1 }, dotted: { "stroke-width": 1.5, "stroke-dasharray": "5 3" },
};

function put(parent, name, attributes = {}, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  parent.append(made);
  return made;
}

// A number to so many significant digits, without an exponent.
const said = (value, digits = 3) => {
  const number = +value.toPrecision(digits);
  return Math.abs(number) < 1e-9 ? "0" : String(number);
};

// Round numbers within a range, about so many.
function ticks(low, high, wanted) {
  const rough = (high - low) / wanted, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((part) => part * power).find((part) => part >= rough);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

function figureOf(parent, title, legend, kind) {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  const name = document.createElement("h3"), picture = document.createElementNS(SVG, "svg");
  figure.className = "panel";
  name.textContent = title;
  caption.append(name);
  const values = legend.map(({ run, look, label }) => {
    const value = document.createElement("span"), dash = document.createElement("span"), number = document.createElement("span");
    value.className = `value run${run}`;
    dash.className = `dash ${look}`;
    value.append(dash, label ? `${label} ` : "", number);
    caption.append(value);
    return number;
  });
  picture.setAttribute("class", kind);
  picture.setAttribute("role", "img");
  picture.setAttribute("aria-label", title);
  figure.append(caption, picture);
  parent.append(figure);
  return [picture, values];
}

// A diagram over time. lines: {film, run, values, look, label, steps}; steps for whole numbers that
// hold until the next state. went(time) is called where one clicks or drags.
function curvesOf(parent, { title, unit, digits, lines, end, decided, went }) {
  const [picture, numbers] = figureOf(parent, `${title}${unit ? ` [${unit}]` : ""}`, lines, "curves");
  const margin = { left: 46, right: 8, top: 8, bottom: 20 };
  let [low, high] = [0, 0], across = () => 0, cursor = null;
  for (const { values } of lines) for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  if (high - low < 1e-9) high = low + 1;
  const room = 0.06 * (high - low);
  [low, high] = [low < 0 ? low - room : low, high + room];

  function draw() {
    const { width, height } = picture.getBoundingClientRect();
    if (!width) return;
    picture.replaceChildren();
    picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const [w, h] = [width - margin.left - margin.right, height - margin.top - margin.bottom];
    across = (time) => margin.left + w * time / end;
    const up = (value) => margin.top + h * (high - value) / (high - low);
    for (const value of ticks(low, high, 5)) {
      put(picture, "line", { x1: margin.left, x2: margin.left + w, y1: up(value), y2: up(value), stroke: value ? "#e3e3e3" : "#888" });
      put(picture, "text", { x: margin.left - 5, y: up(value) + 4, "text-anchor": "end" }, said(value));
    }
    for (const time of ticks(0, end, Math.max(w / 90, 2))) {
      put(picture, "line", { x1: across(time), x2: across(time), y1: margin.top + h, y2: margin.top + h + 4, stroke: "#888" });
      put(picture, "text", { x: across(time), y: height - 4, "text-anchor": "middle" }, `${said(time)} s`);
    }
    decided.forEach((time, run) => put(picture, "line", {
      x1: across(time), x2: across(time), y1: margin.top, y2: margin.top + h,
      stroke: INK[run], "stroke-dasharray": "2 4", class: "decided",
    }));
    for (const { film, run, values, look, steps } of lines) {
      const points = Array.from(values, (value, i) =>
        `${steps && i ? `${across(film.time[i]).toFixed(1)},${up(values[i - 1]).toFixed(1)} ` : ""}${across(film.time[i]).toFixed(1)},${up(value).toFixed(1)}`);
      put(picture, "polyline", { points: points.join(" "), fill: "none", stroke: INK[run], "stroke-linejoin": "round", ...LOOKS[look] });
    }
    cursor = put(picture, "line", { y1: margin.top, y2: margin.top + h, stroke: "#c7362f", "stroke-width": 1.5, class: "cursor" });
  }

  const go = (event) => {
    const box = picture.getBoundingClientRect(), w = box.width - margin.left - margin.right;
    went(end * (event.clientX - box.left - margin.left) / w);
  };
  picture.addEventListener("pointerdown", (event) => {
    picture.setPointerCapture(event.pointerId);
    go(event);
  });
  picture.addEventListener("pointermove", (event) => { if (event.buttons & 1) go(event); });
  return {
    picture, draw,
    show(time) {
      if (cursor) for (const side of ["x1", "x2"]) cursor.setAttribute(side, across(time));
      lines.forEach(({ film, values, steps }, k) => {
        numbers[k].textContent = steps ? said(values[sampleOf(film, time)]) : valueOf(film, values, time).toFixed(digits);
      });
    },
  };
}

// The points of contact from above: pale those of the whole run, bright those of now.
function planOf(parent, films, scene) {
  const legend = films.map((film, run) => ({ run, look: "plain", label: "" }));
  const [picture, numbers] = figureOf(parent, "points of contact from above [m]", legend, "plan");
  let groups = [], place = () => [0, 0];

  function draw() {
    const { width, height } = picture.getBoundingClientRect();
    if (!width) return;
    picture.replaceChildren();
    picture.setAttribute("viewBox", `0 0 ${width} ${height}`);
    let [x0, x1, y0, y1] = [-scene.radius, scene.radius, -scene.radius, scene.radius].map((side) => 0.6 * side);
    for (const { bearing } of films)
      for (let i = 0; i < bearing.length; i += 3) {
        [x0, x1] = [Math.min(x0, bearing[i]), Math.max(x1, bearing[i])];
        [y0, y1] = [Math.min(y0, bearing[i + 1]), Math.max(y1, bearing[i + 1])];
      }
    const scale = Math.min((width - 70) / (x1 - x0), (height - 40) / (y1 - y0));
    const middle = [(x0 + x1) / 2, (y0 + y1) / 2];
    place = (x, y) => [width / 2 + 15 + scale * (x - middle[0]), height / 2 - 8 - scale * (y - middle[1])];
    const reach = [(width - 60) / 2 / scale, (height - 34) / 2 / scale];
    for (const x of ticks(middle[0] - reach[0], middle[0] + reach[0], 5)) {
      put(picture, "line", { x1: place(x, 0)[0], x2: place(x, 0)[0], y1: 6, y2: height - 22, stroke: x ? "#eee" : "#bbb" });
      put(picture, "text", { x: place(x, 0)[0], y: height - 7, "text-anchor": "middle" }, said(x));
    }
    for (const y of ticks(middle[1] - reach[1], middle[1] + reach[1], 4)) {
      put(picture, "line", { x1: 40, x2: width - 6, y1: place(0, y)[1], y2: place(0, y)[1], stroke: y ? "#eee" : "#bbb" });
      put(picture, "text", { x: 34, y: place(0, y)[1] + 4, "text-anchor": "end" }, said(y));
    }
    films.forEach(({ bearing }, run) => {
      const seen = new Set();
      for (let i = 0; i < bearing.length; i += 3) seen.add(place(bearing[i], bearing[i + 1]).map(Math.round).join(" "));
      const path = [...seen].map((point) => `M${point}h0`).join("");
      put(picture, "path", { d: path, stroke: INK[run], "stroke-width": 3.5, "stroke-linecap": "round", opacity: 0.4 });
    });
    groups = films.map((film, run) => put(picture, "path", {
      stroke: INK[run], "stroke-width": run ? 6 : 10, "stroke-linecap": "round", class: "bearing",
    }));
  }

  return {
    picture, draw,
    show(time) {
      films.forEach((film, run) => {
        const points = bearingOf(film, time), parts = [];
        for (let i = 0; i < points.length; i += 3) parts.push(`M${place(points[i], points[i + 1]).map((v) => v.toFixed(1)).join(" ")}h0`);
        groups[run]?.setAttribute("d", parts.join(""));
        numbers[run].textContent = points.length ? `${points.length / 3} now` : "none now";
      });
    },
  };
}
