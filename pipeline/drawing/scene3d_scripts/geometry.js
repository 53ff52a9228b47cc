// Vectors as arrays, quaternions as x y z w, matrices by columns, and the eye's view.
"use strict";

const FIELD = Math.tan(16 * Math.PI / 180); // half the height of the picture at a distance of 1

const add = (a, b, s = 1) => a.map((value, k) => value + s * b[k]);
const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const mix = (a, b, share) => a.map((value, k) => (1 - share) * value + share * b[k]);
const unit = (a) => a.map((value) => value / Math.hypot(...a));

function slerp(a, b, share) {
  let cosine = dot(a, b);
  if (cosine < 0) {
    b = b.map((value) => -value);
    cosine = -cosine;
  }
  if (cosine > 0.9995) return unit(mix(a, b, share));
  const angle = Math.acos(cosine);
  const [p, q] = [Math.sin((1 - share) * angle), Math.sin(share * angle)];
  return unit(a.map((value, k) => p * value + q * b[k]));
}

// Matrix of a rotation, then a shift.
function placed([x, y, z, w], position) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0,
    2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0,
    2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0,
    ...position, 1,
  ];
}

// Right, up and towards the eye, of a view {azimuth, elevation [rad], distance, target [m]}.
function axesOf({ azimuth, elevation }) {
  const [c, s] = [Math.cos(elevation), Math.sin(elevation)];
  const eye = [c * Math.cos(azimuth), c * Math.sin(azimuth), s];
  const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
  return [right, cross(eye, right), eye];
}

function cameraOf(view, aspect) {
  const axes = axesOf(view);
  const eye = add(view.target, axes[2], view.distance);
  const [right, up, back] = axes.map((axis) => [...axis, -dot(axis, eye)]);
  const [near, far] = [0.02 * view.distance, view.distance + 2000];
  const [a, b] = [(far + near) / (near - far), 2 * far * near / (near - far)];
  const rows = [
    right.map((value) => value / (FIELD * aspect)),
    up.map((value) => value / FIELD),
    back.map((value, k) => a * value + (k === 3 ? b : 0)),
    back.map((value) => -value),
  ];
  return { matrix: [0, 1, 2, 3].flatMap((k) => rows.map((row) => row[k])), axes };
}

// The nearest view with balls of a radius around all points in the picture: each of its sides
// bounds where the eye may be.
function viewOf({ azimuth, elevation }, points, radius, aspect) {
  const axes = axesOf({ azimuth, elevation });
  const slopes = [0.88 * FIELD * aspect, 0.88 * FIELD];
  const most = [[-Infinity, -Infinity], [-Infinity, -Infinity]];
  let [nearest, sum] = [-Infinity, 0];
  for (const point of points) {
    const depth = dot(axes[2], point);
    nearest = Math.max(nearest, depth);
    sum += depth;
    for (const k of [0, 1]) {
      const aside = dot(axes[k], point);
      most[k][0] = Math.max(most[k][0], slopes[k] * depth + aside);
      most[k][1] = Math.max(most[k][1], slopes[k] * depth - aside);
    }
  }
  const margins = slopes.map((slope) => radius * Math.hypot(1, slope));
  const depths = [0, 1].map((k) => (most[k][0] + most[k][1] + 2 * margins[k]) / (2 * slopes[k]));
  const [right, up] = most.map(([plus, minus]) => (plus - minus) / 2);
  const middle = sum / points.length;
  const target = [0, 1, 2].map((k) => right * axes[0][k] + up * axes[1][k] + middle * axes[2][k]);
  return { azimuth, elevation, target, distance: Math.max(nearest + radius, ...depths) - middle };
}
