// Cells of the response diagrams under the pointer, a finger or the arrow keys, and runs that are
// played in the diagram where they are.
//
// window.vsr is for tests: the run that is played (null for none), its time [s], the rock's position
// [m], triangles drawn last and error, the last one of WebGL (0 for none).
"use strict";

const { axes, diagrams, watched } = JSON.parse(byId("data").textContent);
const figures = [...document.querySelectorAll(".diagram")];

// ---- What a cell tells

const lettersOf = (packed) => packed.replace(/([A-Z])(\d+)/g, (_, letter, count) => letter.repeat(+count));

function toldOf(letters, row, column) {
  const code = letters.charCodeAt(row * axes.pga.length + column) - 65, rules = axes.rules.length;
  const motion = axes.record ? `${axes.record[row]}, PGV/PGA ${axes.pgv_pga[row]} s` : `PGV/PGA ${axes.pgv_pga[row]} s`;
  return [`PGA ${axes.pga[column]} g, ${motion}`, axes.outcomes[Math.floor(code / rules)], axes.rules[code % rules]];
}

// Between which two borders a share of the picture lies; they ascend or descend.
function within(borders, share) {
  const up = borders.at(-1) > borders[0] ? 1 : -1;
  const at = borders.findIndex((border) => up * border > up * share) - 1;
  return at < 0 ? null : at;
}

function cellsOf(figure, { across, down, cells }, number) {
  const letters = lettersOf(cells), area = figure.querySelector(".cells"), told = figure.querySelector(".told");
  const frame = figure.querySelector(".frame");
  let at = null;

  function tell(row, column) {
    at = [row, column];
    const [motion, outcome, how] = toldOf(letters, row, column);
    const strong = document.createElement("strong");
    strong.textContent = outcome;
    told.replaceChildren(`${motion}: `, strong, `; ${how}`);
    told.hidden = false;
    const [top, bottom] = [down[row + 1], down[row]];
    Object.assign(frame.style, {
      left: `${100 * across[column]}%`, width: `${100 * (across[column + 1] - across[column])}%`,
      top: `${100 * top}%`, height: `${100 * (bottom - top)}%`,
    });
    frame.hidden = false;
  }

  function point(event) {
    const box = area.getBoundingClientRect();
    const column = within(across, (event.clientX - box.left) / box.width);
    const row = within(down, (event.clientY - box.top) / box.height);
    if (row !== null && column !== null) tell(row, column);
  }

  function hide() {
    if (document.activeElement !== area) told.hidden = frame.hidden = true;
  }

  area.addEventListener("pointermove", point);
  area.addEventListener("pointerleave", hide);
  area.addEventListener("blur", () => { told.hidden = frame.hidden = true; });
  area.addEventListener("pointerdown", point);
  area.addEventListener("focus", () => {
    tell(...at ?? [down, across].map((sides) => Math.floor((sides.length - 1) / 2)));
  });
  area.addEventListener("keydown", (event) => {
    const way = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowUp: [1, 0], ArrowDown: [-1, 0] }[event.key];
    if (event.target !== area || !way || !at || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const kept = (value, sides) => Math.min(Math.max(value, 0), sides.length - 2);
    tell(kept(at[0] + way[0], down), kept(at[1] + way[1], across));
  });
  watched?.places.forEach((place, run) => {
    if (place.diagram !== number) return;
    const spot = document.createElement("button");
    spot.type = "button";
    spot.className = "spot";
    spot.textContent = "▶";
    spot.title = `play this run: ${place.why}`;
    spot.setAttribute("aria-label", `play the run ${place.why}, ${place.name}`);
    spot.style.left = `${50 * (across[place.column] + across[place.column + 1])}%`;
    spot.style.top = `${50 * (down[place.row] + down[place.row + 1])}%`;
    const other = watched.places.find((one) => one !== place && one.diagram === number && one.row === place.row);
    if (other) spot.classList.add(other.column > place.column ? "left" : "right");
    spot.addEventListener("click", () => watch(run));
    area.append(spot);
  });
  return tell;
}

// ---- Runs that are played

const player = byId("player");
const scene = watched && sceneOf(watched.scene), films = watched ? watched.films.map(filmOf) : [];
const shared = { view: null }, shown = { triangles: 0, error: 0 };
let run = null, stage = null;

const changed = oncePerPicture(show);
const clock = clockOf(() => films[run].time.at(-1), changed), showTime = transportOf(clock);

function reset() {
  shared.view = viewOfFilms(scene, films, fitted(byId("stage")));
  changed();
}

// The player comes to the diagram of its run.
function watch(chosen) {
  run = chosen;
  const place = watched.places[run];
  for (const part of document.querySelectorAll(".told, .frame")) part.hidden = true;
  figures[place.diagram].append(player);
  tells[place.diagram](place.row, place.column);
  player.hidden = false;
  stage ??= stageOf(byId("stage"), scene, shared, { changed, reset });
  byId("no-stage").hidden = stage !== null;
  byId("what").textContent = `${place.why}: ${place.name}`;
  byId("time").max = films[run].time.at(-1);
  clock.time = 0;
  reset();
  clock.play(true);
  player.scrollIntoView({ block: "nearest" });
}

function show() {
  if (run === null) return;
  const film = films[run], { time } = clock, count = bearingOf(film, time).length / 3;
  if (stage) Object.assign(shown, stage.show(film, time));
  byId("state").textContent = `tilt ${valueOf(film, film.tilt, time).toFixed(1)}° · ${count} ${count === 1 ? "point" : "points"} of contact`
    + (time > film.decided ? " · outcome decided" : "");
  showTime();
}

function listen() {
  byId("stage").addEventListener("keydown", (event) => {
    if (event.key !== " ") return;
    event.preventDefault();
    clock.play(!clock.playing);
  });
  document.querySelectorAll("[data-watch]").forEach((button) => {
    button.addEventListener("click", () => watch(+button.dataset.watch));
  });
}

window.vsr = Object.freeze({
  get run() { return run; },
  get time() { return clock.time; },
  get position() { return run === null ? null : poseOf(films[run], clock.time).position; },
  get triangles() { return shown.triangles; },
  get error() { return shown.error; },
});

const tells = figures.map((figure, number) => cellsOf(figure, diagrams[number], number));
if (watched) listen();
