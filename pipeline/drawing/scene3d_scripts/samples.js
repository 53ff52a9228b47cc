// Arrays as they are packed into a page, and where a rock is between two samples of a run.
"use strict";

function decoded(text, Kind) {
  const letters = atob(text), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = letters.charCodeAt(i);
  return new Kind(bytes.buffer);
}

const meshIn = ({ vertices, faces }) => ({
  vertices: decoded(vertices, Float32Array), faces: decoded(faces, Uint32Array),
});

const placeIn = (samples, i) => Array.from(samples.place.subarray(3 * i, 3 * i + 3));
const turnIn = (samples, i) => unit(Array.from(samples.turn.subarray(4 * i, 4 * i + 4)));

// The sample at or before a time [s] among those from first to last, and the share of the way
// from it to the next.
function between(samples, first, last, time) {
  let [low, high] = [first, last];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (samples.time[middle] <= time) low = middle;
    else high = middle;
  }
  const span = samples.time[high] - samples.time[low];
  return [low, high, span > 0 ? Math.min(Math.max((time - samples.time[low]) / span, 0), 1) : 0];
}

function poseIn(samples, first, last, time) {
  const [low, high, share] = between(samples, first, last, time);
  return {
    position: mix(placeIn(samples, low), placeIn(samples, high), share),
    quaternion: slerp(turnIn(samples, low), turnIn(samples, high), share),
    speed: (1 - share) * samples.speed[low] + share * samples.speed[high],
  };
}
