// What is shown: a run, a time and a view, by mouse, touch and keys. Drawn when something changed.
//
// window.vsr is for tests: time [s], position [m] and quaternion (x y z w) of the rock, run (its
// place in the list, null without runs), view (azimuth, elevation [rad], distance, target [m]),
// playing, triangles drawn last, and error, the last one of WebGL (0 for none).
"use strict";

const canvas = byId("scene");
const data = unpacked(JSON.parse(byId("data").textContent));
const { runs, samples } = data;
const state = { run: runs.length ? 0 : null, view: null, triangles: 0, error: 0 };
let draw = null, controls = null;

function unpacked(packed) {
  const given = packed.samples, first = [0];
  for (const count of given.count) first.push(first.at(-1) + count);
  const low = decoded(given.low, Float32Array), step = decoded(given.step, Float32Array);
  const place = Float32Array.from(decoded(given.place, Uint16Array));
  for (let run = 0; run < given.count.length; run++)
    for (let i = 3 * first[run]; i < 3 * first[run + 1]; i++)
      place[i] = low[3 * run + i % 3] + step[3 * run + i % 3] * place[i];
  const speed = Float32Array.from(
    decoded(given.speed, Uint16Array), (value) => value / 65535 * given.largest_speed);
  return {
    ...packed, terrain: meshIn(packed.terrain), rock: meshIn(packed.rock),
    samples: {
      first, place, speed, largest: given.largest_speed,
      time: decoded(given.time, Float32Array), turn: decoded(given.turn, Int16Array),
    },
  };
}

// ---- The rock at a time

const placeOf = (sample) => placeIn(samples, sample);
const startOf = (run) => run === null ? data.start : placeOf(samples.first[run]);
const endOf = (run) => run === null ? 0 : samples.time[samples.first[run + 1] - 1];
const request = oncePerPicture(show);
const clock = clockOf(() => endOf(state.run), request), showTime = transportOf(clock);

function poseNow() {
  if (state.run === null) return { position: data.start, quaternion: [0, 0, 0, 1], speed: 0 };
  const [first, next] = [samples.first[state.run], samples.first[state.run + 1]];
  return poseIn(samples, first, next - 1, clock.time);
}

function choose(run) {
  state.run = run;
  byId("run").value = run;
  byId("time").max = endOf(run);
  clock.set(0);
}

// ---- The picture and what is written around it

const aspect = () => canvas.width / canvas.height;

function firstView() {
  const points = [data.start];
  for (let sample = 0; sample < samples.speed.length; sample++) points.push(placeOf(sample));
  return viewOf(data.view, points, data.radius, aspect());
}

function show() {
  const pose = poseNow(), camera = cameraOf(state.view, aspect());
  state.triangles = draw({ camera, pose, run: state.run, all: byId("others").checked });
  state.error = gl.getError();
  write(pose, camera);
}

const metres = (value) => `${value.toFixed(2)} m`;
const brief = (value, digits) => String(+value.toPrecision(digits));

function nameOf(run) {
  return `PGA ${brief(run.pga, 3)} g, PGV/PGA ${brief(run.pgv_pga, 3)} s, yaw ${run.yaw}°, `
    + `friction ${run.friction}, path ${metres(run.trajectory_length)}`;
}

function write(pose, camera) {
  byId("speed").textContent = `${pose.speed.toFixed(2)} m/s`;
  byId("height").textContent = metres(pose.position[2]);
  byId("distance").textContent = metres(Math.hypot(...add(pose.position, startOf(state.run), -1)));
  showTime();
  const power = 10 ** Math.floor(Math.log10(100 * controls.pixel()));
  const length = [5, 2, 1].map((step) => step * power).find((value) => value <= 100 * controls.pixel());
  byId("ruler").style.width = `${length / controls.pixel()}px`;
  byId("length").textContent = `${brief(length, 1)} m`;
  const flat = (v) => [dot(camera.axes[0], v), -dot(camera.axes[1], v)];
  [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, k) => {
    const [x, y] = flat(axis), end = `translate(${44 * x} ${44 * y})`;
    setAll(byId("xyz"[k]), { x2: 34 * x, y2: 34 * y });
    setAll(byId("xyz"[k]).nextElementSibling, { transform: end, opacity: Math.hypot(x, y) > 0.4 ? 1 : 0 });
  });
  if (state.run === null || !data.along_x) return;
  const yaw = runs[state.run].yaw * Math.PI / 180;
  const [x, y] = flat([Math.cos(yaw), -Math.sin(yaw), 0]).map((value) => 30 * value);
  setAll(byId("shaking"), { x1: -x, y1: -y, x2: x, y2: y });
}

function setAll(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
}

function trouble(text) {
  byId("trouble").textContent = text;
  byId("trouble").hidden = false;
}

// ---- Under the pointer, and what is listened to

function reset() {
  state.view = firstView();
  request();
}

// The sample of a path that is drawn, next to the pointer and at most 14 pixels off.
function nearest(event) {
  if (state.run === null) return null;
  const { matrix: m } = cameraOf(state.view, aspect()), box = canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const all = byId("others").checked;
  const [start, end] = all ? [0, samples.speed.length] : samples.first.slice(state.run, state.run + 2);
  let [least, sample] = [14 ** 2, -1];
  for (let i = start; i < end; i++) {
    const [p, q, r] = [samples.place[3 * i], samples.place[3 * i + 1], samples.place[3 * i + 2]];
    const w = m[3] * p + m[7] * q + m[11] * r + m[15];
    const u = (0.5 + 0.5 * (m[0] * p + m[4] * q + m[8] * r + m[12]) / w) * box.width - x;
    const v = (0.5 - 0.5 * (m[1] * p + m[5] * q + m[9] * r + m[13]) / w) * box.height - y;
    if (w > 0 && u * u + v * v < least) [least, sample] = [u * u + v * v, i];
  }
  return sample < 0 ? null : { sample, run: samples.first.filter((first) => first <= sample).length - 1 };
}

function hover(event) {
  const found = event && nearest(event), tip = byId("tip");
  tip.hidden = !found;
  if (!found) return;
  const place = placeOf(found.sample);
  tip.textContent = [
    ...nameOf(runs[found.run]).split(", "), "", `time ${samples.time[found.sample].toFixed(2)} s`,
    `speed ${samples.speed[found.sample].toFixed(2)} m/s`, `height z ${metres(place[2])}`,
    `from start ${metres(Math.hypot(...add(place, startOf(found.run), -1)))}`,
  ].join("\n");
  const box = canvas.getBoundingClientRect();
  tip.style.left = `${Math.min(event.clientX - box.left + 14, box.width - tip.offsetWidth)}px`;
  tip.style.top = `${Math.min(event.clientY - box.top + 14, box.height - tip.offsetHeight)}px`;
}

function listen() {
  const on = (element, event, act, options) => element.addEventListener(event, act, options);
  controls = controlsOf(canvas, {
    view: () => state.view,
    radius: data.radius,
    changed: request,
    reset,
    hovered: hover,
    clicked: (event) => {
      const found = nearest(event);
      if (found) choose(found.run);
    },
  });
  on(canvas, "keydown", (event) => {
    if (event.key !== " ") return;
    event.preventDefault();
    clock.play(!clock.playing);
  });
  on(canvas, "webglcontextlost", () => trouble("The browser lost access to the graphics card. Please reload the page."));
  on(byId("time"), "keydown", (event) => {
    const step = { ArrowRight: 0.05, ArrowUp: 0.05, ArrowLeft: -0.05, ArrowDown: -0.05 }[event.key];
    if (!step) return;
    event.preventDefault();
    clock.set(clock.time + step);
  });
  on(byId("run"), "change", (event) => choose(+event.target.value));
  on(byId("others"), "change", request);
  new ResizeObserver(() => {
    fitted(canvas);
    request();
  }).observe(canvas);
}

function begin() {
  runs.forEach((run, k) => byId("run").add(new Option(`${k + 1}: ${nameOf(run)}, ${run.movement}, ${run.stop}`, k)));
  if (!runs.length) {
    byId("run").add(new Option("no run left the seat"));
  }
  if (!runs.length || !data.along_x) {
    byId("shaking").remove();
    byId("along").remove();
  }
  for (const id of ["run", "time", "play", "others"]) byId(id).disabled = !runs.length;
  const colours = data.colours.map((part) => `rgb(${part.map((value) => Math.round(255 * value))})`);
  byId("bar").style.background = `linear-gradient(to right, ${colours})`;
  byId("half").textContent = brief(samples.largest / 2, 2);
  byId("largest").textContent = brief(samples.largest, 2);
  fitted(canvas);
  state.view = firstView();
  listen();
  const lengths = runs.map((run) => run.trajectory_length);
  if (runs.length) choose(lengths.indexOf(Math.max(...lengths)));
  else request();
}

window.vsr = Object.freeze({
  get time() { return clock.time; },
  get position() { return poseNow().position; },
  get quaternion() { return poseNow().quaternion; },
  get run() { return state.run; },
  get view() { return { ...state.view }; },
  get playing() { return clock.playing; },
  get triangles() { return state.triangles; },
  get error() { return state.error; },
});

const gl = canvas.getContext("webgl2", { antialias: true });
if (gl) {
  draw = drawingOf(gl, data);
  begin();
} else {
  trouble("This page draws with WebGL 2, which this browser does not provide. Try another browser, "
    + "or allow this one to use the graphics card.");
}
