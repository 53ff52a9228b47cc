// What pages that play a run share: time that runs, and the button, slider and text that show it.
"use strict";

const byId = (id) => document.getElementById(id);

// Time [s] from 0 to end() that runs while it is played, at a pace; told() with each change.
function clockOf(end, told) {
  const clock = { time: 0, playing: false, pace: 1, end };
  let latest = 0; // of the loops of pictures: one that is begun anew ends the one before
  clock.set = (time) => {
    clock.time = Math.min(Math.max(time, 0), end());
    told();
  };
  clock.play = (on) => {
    if (on && clock.time >= end()) clock.time = 0;
    clock.playing = on;
    const own = ++latest;
    let last = performance.now();
    const tick = (now) => {
      if (!clock.playing || own !== latest) return;
      clock.time = Math.min(clock.time + clock.pace * Math.max(now - last, 0) / 1000, end());
      last = now;
      clock.playing = clock.time < end();
      told();
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
    told();
  };
  return clock;
}

// A function that has something done once before the next picture, however often it is called.
function oncePerPicture(act) {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      act();
    });
  };
}

// The button, the slider and the time of a page play a clock; returns what brings them up to date.
function transportOf(clock) {
  byId("play").addEventListener("click", () => clock.play(!clock.playing));
  byId("time").addEventListener("input", (event) => {
    clock.playing = false;
    clock.set(event.target.valueAsNumber);
  });
  return () => {
    byId("now").textContent = `${clock.time.toFixed(2)} of ${clock.end().toFixed(2)} s`;
    byId("time").value = clock.time;
    byId("play").textContent = clock.playing ? "Pause" : "Play";
  };
}
