// Pictures and diagrams of one or two runs at one time.
//
// window.vsr is for tests: time [s], playing, and of each run position [m], quaternion (x y z w),
// points of contact [m], triangles drawn last and error, the last one of WebGL (0 for none).
"use strict";

const { scene: packedScene, films: packedFilms } = JSON.parse(byId("data").textContent);
const scene = sceneOf(packedScene), films = packedFilms.map(filmOf);
const end = Math.max(...films.map((film) => film.time.at(-1)));
const shared = { view: null };
const drawn = films.map(() => ({ triangles: 0, error: 0 }));
const boxes = [...document.querySelectorAll(".stage")];
const part = (run, name) => boxes[run].querySelector(name);

const changed = oncePerPicture(show);
const clock = clockOf(() => end, changed), showTime = transportOf(clock);
const stages = films.map((film, run) => stageOf(part(run, "canvas"), scene, shared, { changed, reset }));
const panels = panelsOf(byId("panels"));

function reset() {
  shared.view = viewOfFilms(scene, films, fitted(part(0, "canvas")));
  changed();
}

function panelsOf(parent) {
  const lines = (name, look, label) => films.map((film, run) => ({ film, run, values: film[name], look, label }));
  const common = { end, decided: films.map((film) => film.decided), went: clock.set };
  for (const film of films) {
    film.total = film.kinetic.map((value, i) => value + film.potential[i]);
    film.points = film.time.map((_, i) => film.first[i + 1] - film.first[i]);
    film.axes.forEach((axis, k) => {
      const every = film.axes.length;
      for (const name of ["acceleration", "velocity"])
        film[name + axis] = film.time.map((_, i) => film[name][every * i + k]);
    });
  }
  const axes = [...new Set(films.flatMap((film) => film.axes))];
  const looks = ["plain", "dotted", "thin"];
  const table = (name) => axes.flatMap((axis, k) => films.flatMap((film, run) => film[name + axis]
    ? [{ film, run, values: film[name + axis], look: looks[k], label: axes.length > 1 ? axis : "" }] : []));
  const big = Math.max(...films.flatMap((film) => Array.from(film.total, Math.abs)));
  const digits = big < 1 ? 4 : big < 100 ? 2 : 0;
  return [
    curvesOf(parent, { title: "tilt", unit: "deg", digits: 1, lines: lines("tilt", "plain", ""), ...common }),
    curvesOf(parent, {
      title: "energy", unit: "J", digits, ...common,
      lines: [...lines("total", "plain", "sum"), ...lines("kinetic", "thin", "kinetic"), ...lines("potential", "dotted", "potential")],
    }),
    curvesOf(parent, {
      title: "number of points of contact", unit: "", digits: 0, ...common,
      lines: lines("points", "plain", "").map((line) => ({ ...line, steps: true })),
    }),
    planOf(parent, films, scene),
    curvesOf(parent, { title: "acceleration of the table", unit: "g", digits: 3, lines: table("acceleration"), ...common }),
    curvesOf(parent, { title: "velocity of the table", unit: "m/s", digits: 3, lines: table("velocity"), ...common }),
  ];
}

function show() {
  const { time } = clock;
  films.forEach((film, run) => {
    const tilt = valueOf(film, film.tilt, time), count = bearingOf(film, time).length / 3;
    part(run, ".now").textContent = `${time.toFixed(2)} s · tilt ${tilt.toFixed(1)}° · ${count} ${count === 1 ? "point" : "points"} of contact`;
    part(run, ".after").hidden = time <= film.decided + 1e-9;
    if (!stages[run]) return;
    const { camera, triangles, error } = stages[run].show(film, time);
    drawn[run] = { triangles, error };
    arrow(part(run, ".arrow"), film, camera, time);
  });
  for (const panel of panels) panel.show(time);
  showTime();
}

// The acceleration of the table as it is seen: as long as its share of the largest in the run.
function arrow(path, film, camera, time) {
  const every = film.axes.length, i = sampleOf(film, time), own = [0, 0, 0];
  film.axes.forEach((axis, k) => { own["xyz".indexOf(axis)] = film.acceleration[every * i + k]; });
  const most = film.acceleration.reduce((high, value) => Math.max(high, Math.abs(value)), 1e-12);
  const [c, s] = [Math.cos(film.along), Math.sin(film.along)];
  const at = [c * own[0] - s * own[1], s * own[0] + c * own[1], own[2]];
  const [x, y] = [0, 1].map((k) => (k ? -46 : 46) * dot(camera.axes[k], at) / most);
  const length = Math.hypot(x, y);
  if (length < 1) return path.setAttribute("d", "");
  const [u, v] = [x / length, y / length], head = Math.min(11, length), neck = [x - head * u, y - head * v];
  const corner = (p, side, off) => `${(p[0] - side * off * v).toFixed(1)} ${(p[1] + side * off * u).toFixed(1)}`;
  const points = [corner([0, 0], 1, 2), corner(neck, 1, 2), corner(neck, 1, 6), corner([x, y], 1, 0),
    corner(neck, -1, 6), corner(neck, -1, 2), corner([0, 0], -1, 2)];
  return path.setAttribute("d", `M${points.join("L")}Z`);
}

function step(way, event) {
  if (!event.shiftKey) return clock.set(clock.time + 0.05 * way);
  const times = films[0].time, i = sampleOf(films[0], clock.time);
  return clock.set(times[Math.min(Math.max(i + way, 0), times.length - 1)]);
}

const KEYS = {
  " ": () => clock.play(!clock.playing),
  ArrowRight: (event) => step(1, event), ArrowLeft: (event) => step(-1, event),
  Home: () => clock.set(0), End: () => clock.set(end),
};

function listen() {
  byId("pace").addEventListener("change", (event) => { clock.pace = +event.target.value; });
  document.addEventListener("keydown", (event) => {
    const own = event.target.matches("button, select") || (event.target.matches("canvas") && event.key !== " ");
    if (own || !KEYS[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (event.key !== " ") clock.playing = false;
    KEYS[event.key](event);
  });
  const redraw = oncePerPicture(() => {
    for (const panel of panels) panel.draw();
    show();
  });
  for (const { picture } of panels) new ResizeObserver(redraw).observe(picture);
}

window.vsr = Object.freeze({
  get time() { return clock.time; },
  get playing() { return clock.playing; },
  get runs() {
    return films.map((film, run) => {
      const { position, quaternion } = poseOf(film, clock.time);
      return { position, quaternion, bearing: Array.from(bearingOf(film, clock.time)), ...drawn[run] };
    });
  },
});

byId("time").max = end;
boxes.forEach((box, run) => {
  if (stages[run]) return;
  part(run, ".trouble").textContent = "This picture needs WebGL 2, which this browser does not provide; the diagrams below do without it.";
  part(run, ".trouble").hidden = false;
});
listen();
reset();
