// A run that is played: its samples, the rock at a time, and a canvas that shows it.
"use strict";

// A run as `pipeline.stages.replay.film` packs it; first says where the points of each sample begin.
function filmOf(packed) {
  const film = { ...packed, turn: decoded(packed.turn, Int16Array), first: [0] };
  for (const name of ["time", "place", "speed", "bearing", ...packed.curves])
    film[name] = decoded(packed[name], Float32Array);
  for (const count of decoded(packed.count, Uint8Array)) film.first.push(film.first.at(-1) + count);
  return film;
}

// Before its first and after its last sample a run stands still.
const poseOf = (film, time) => poseIn(film, 0, film.time.length - 1, time);

function sampleOf(film, time) {
  const [low, high, share] = between(film, 0, film.time.length - 1, time);
  return share >= 1 ? high : low;
}

const bearingOf = (film, time) => {
  const i = sampleOf(film, time);
  return film.bearing.subarray(3 * film.first[i], 3 * film.first[i + 1]);
};

function valueOf(film, values, time) {
  const [low, high, share] = between(film, 0, film.time.length - 1, time);
  return (1 - share) * values[low] + share * values[high];
}

const sceneOf = (packed) => ({ ...packed, terrain: meshIn(packed.terrain), rock: meshIn(packed.rock) });

// The nearest view that holds a run until some time after it was decided.
function viewOfFilms(scene, films, aspect) {
  const points = films.flatMap((film) => {
    const last = sampleOf(film, film.decided + scene.shown_after);
    return Array.from({ length: last + 1 }, (_, i) => placeIn(film, i));
  });
  return viewOf(scene.view, points, scene.radius, aspect);
}

// What draws runs into a canvas; null without WebGL 2. shared.view is the view.
function stageOf(canvas, scene, shared, { changed, reset }) {
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) return null;
  const draw = drawingOf(gl, scene);
  const view = () => shared.view;
  controlsOf(canvas, { view, radius: scene.radius, changed, reset, scrolls: true });
  new ResizeObserver(changed).observe(canvas);
  return {
    show(film, time) {
      const camera = cameraOf(shared.view, fitted(canvas));
      const triangles = draw({ camera, pose: poseOf(film, time), bearing: bearingOf(film, time) });
      return { camera, triangles, error: gl.getError() };
    },
  };
}
