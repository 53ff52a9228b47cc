// A view that is rotated, panned and zoomed by mouse, touch and keys.
//
// view() is the view {azimuth, elevation [rad], distance, target [m]}, which is changed; changed is
// called thereafter. In a page that scrolls, the wheel zooms with Ctrl only.
"use strict";

function controlsOf(canvas, { view, radius, changed, reset, scrolls = false, hovered = () => {}, clicked = () => {} }) {
  const pixel = () => 2 * FIELD * view().distance / canvas.clientHeight; // [m], mid-view
  const fingers = new Map();
  let travelled = 0;

  function turn(across, down) {
    view().azimuth -= across;
    view().elevation = Math.min(Math.max(view().elevation + down, -0.3), 1.55);
    changed();
  }

  function move(across, down) {
    const [right, up] = axesOf(view());
    view().target = add(add(view().target, right, -across * pixel()), up, down * pixel());
    changed();
  }

  // Zooms about a point some pixels off the middle, which stays where it is.
  function zoom(factor, across = 0, down = 0) {
    const before = pixel();
    view().distance = Math.min(Math.max(view().distance * factor, 0.5 * radius), 2000);
    const grown = before / pixel() - 1;
    move(-across * grown, -down * grown);
  }

  function press(event) {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
    travelled = 0;
  }

  function drag(event) {
    const before = fingers.get(event.pointerId);
    if (!before) {
      hovered(event);
      return;
    }
    const [across, down] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
    travelled += Math.abs(across) + Math.abs(down);
    fingers.set(event.pointerId, event);
    hovered(null);
    if (other) {
      const apart = (finger) => Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY);
      zoom(Math.max(apart(before), 1) / Math.max(apart(event), 1));
      move(across / 2, down / 2);
    } else if (event.shiftKey || event.buttons & 6) move(across, down);
    else turn(0.006 * across, 0.006 * down);
  }

  function release(event) {
    const pressed = fingers.delete(event.pointerId);
    if (pressed && travelled <= 4 && event.type === "pointerup") clicked(event);
  }

  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0),
    ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
    "+": () => zoom(0.85), "=": () => zoom(0.85), "-": () => zoom(1 / 0.85), 0: reset,
  };

  const on = (event, act, options) => canvas.addEventListener(event, act, options);
  on("pointerdown", press);
  on("pointermove", drag);
  on("pointerup", release);
  on("pointercancel", release);
  on("pointerleave", () => hovered(null));
  on("contextmenu", (event) => event.preventDefault());
  on("wheel", (event) => {
    if (scrolls && !event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    const middle = [canvas.clientWidth / 2, canvas.clientHeight / 2];
    zoom(Math.exp(0.0012 * event.deltaY), event.offsetX - middle[0], event.offsetY - middle[1]);
  }, { passive: false });
  on("keydown", (event) => {
    if (!KEYS[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  return { pixel };
}

// As many pixels as the screen has for a canvas.
function fitted(canvas) {
  const size = [canvas.clientWidth, canvas.clientHeight];
  const [width, height] = size.map((side) => Math.max(Math.round(side * (window.devicePixelRatio || 1)), 1));
  if (width !== canvas.width || height !== canvas.height) [canvas.width, canvas.height] = [width, height];
  return width / height;
}
