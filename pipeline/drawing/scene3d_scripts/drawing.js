// Ground, rock and paths in WebGL 2.
"use strict";

const MESH = [`#version 300 es
in vec3 corner;
uniform mat4 camera, model;
out vec3 at;
void main() {
  vec4 world = model * vec4(corner, 1.0);
  at = world.xyz;
  gl_Position = camera * world;
}
`, `#version 300 es
precision highp float;
in vec3 at;
uniform vec3 low, high, sun, rock; // colours at two heights; towards the sun; centre of the rock
uniform vec2 heights;
uniform float contour, grid, radius;
out vec4 colour;
void main() {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at))); // of the face, towards the eye
  vec3 own = mix(low, high, clamp((at.z - heights.x) / max(heights.y - heights.x, 1e-3), 0.0, 1.0));
  float light = 0.5 + 0.12 * normal.z + 0.5 * max(dot(normal, sun), 0.0);
  if (contour > 0.0) { // the ground: contours half a step off its zero, a soft shadow below the rock
    float level = at.z / contour, rate = max(fwidth(level), 1e-6);
    float line = 1.0 - smoothstep(0.3, 1.1, abs(fract(level) - 0.5) / rate);
    own *= 1.0 - 0.22 * line * (1.0 - smoothstep(0.15, 0.4, rate));
    if (grid > 0.0) { // squares of a level pedestal
      vec2 place = at.xy / grid, pace = max(fwidth(place), 1e-6);
      vec2 away = abs(fract(place - 0.5) - 0.5) / pace;
      float rule = 1.0 - smoothstep(0.4, 1.2, min(away.x, away.y));
      own *= 1.0 - 0.16 * rule * (1.0 - smoothstep(0.2, 0.5, max(pace.x, pace.y)));
    }
    float off = length(at.xy - rock.xy) / radius, below = (rock.z - at.z) / radius;
    light *= 1.0 - 0.5 * (1.0 - smoothstep(0.2, 1.0, off)) * step(0.0, below) * exp(-0.15 * below);
  }
  colour = vec4(own * light, 1.0);
}
`];

// A piece of a path is two triangles of a width in pixels. A texture holds the samples, one a
// texel: place and speed from 0 to 1, negative less one for the last of a run.
const ROW = 1024;
const LINE = [`#version 300 es
precision highp sampler2D;
uniform sampler2D samples;
uniform int first;
uniform mat4 camera;
uniform vec2 size;
uniform float width, opacity;
uniform vec3 stops[5];
uniform bool casing;
out vec4 tone;
vec4 sampleAt(int i) { return texelFetch(samples, ivec2(i % ${ROW}, i / ${ROW}), 0); }
void main() {
  int piece = first + gl_VertexID / 6, corner = gl_VertexID % 6;
  bool second = corner == 1 || corner == 4 || corner == 3;
  vec4 a = sampleAt(piece), b = sampleAt(piece + 1);
  vec4 from = camera * vec4(a.xyz, 1.0), to = camera * vec4(b.xyz, 1.0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // nowhere: between two runs, or behind the eye
  tone = vec4(0.0);
  if (a.w < 0.0 || from.w < 1e-3 || to.w < 1e-3) return;
  vec2 way = (to.xy / to.w - from.xy / from.w) * size;
  way = length(way) > 1e-4 ? normalize(way) : vec2(1.0, 0.0);
  vec2 off = vec2(-way.y, way.x) * (corner == 0 || corner == 1 || corner == 3 ? 1.0 : -1.0);
  if (opacity == 1.0) off += way * (second ? 0.5 : -0.5); // joins the pieces; else they overlap
  gl_Position = second ? to : from;
  gl_Position.xy += off * width / size * gl_Position.w;
  float pace = second ? (b.w < 0.0 ? -1.0 - b.w : b.w) : a.w;
  float place = 4.0 * clamp(pace, 0.0, 1.0);
  int stop = min(int(place), 3);
  tone = vec4(casing ? vec3(1.0) : mix(stops[stop], stops[stop + 1], place - float(stop)), opacity);
}
`, `#version 300 es
precision highp float;
in vec4 tone;
out vec4 colour;
void main() { colour = tone; }
`];

// Points of contact, in pixels, seen through the rock: a disc with a rim.
const POINT = [`#version 300 es
in vec3 at;
uniform mat4 camera;
uniform float width;
void main() {
  gl_Position = camera * vec4(at, 1.0);
  gl_PointSize = width;
}
`, `#version 300 es
precision highp float;
out vec4 colour;
void main() {
  float off = 2.0 * length(gl_PointCoord - 0.5);
  if (off > 1.0) discard;
  colour = vec4(off > 0.62 ? vec3(1.0) : vec3(0.78, 0.08, 0.10), 1.0);
}
`];

const LOW = [0.70, 0.70, 0.64], HIGH = [0.97, 0.94, 0.87], ROCK = [0.93, 0.55, 0.10];

function built(gl, sources) {
  const program = gl.createProgram();
  sources.forEach((source, k) => {
    const shader = gl.createShader([gl.VERTEX_SHADER, gl.FRAGMENT_SHADER][k]);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  });
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    const words = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error([gl.getProgramInfoLog(program), ...words].join("\n"));
  }
  const uniforms = {};
  for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
    const { name } = gl.getActiveUniform(program, k);
    uniforms[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms, attribute: (name) => gl.getAttribLocation(program, name) };
}

function buffered(gl, target, values) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, values, gl.STATIC_DRAW);
  return buffer;
}

function meshOf(gl, program, { vertices, faces }) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  buffered(gl, gl.ARRAY_BUFFER, vertices);
  gl.enableVertexAttribArray(program.attribute("corner"));
  gl.vertexAttribPointer(program.attribute("corner"), 3, gl.FLOAT, false, 0, 0);
  buffered(gl, gl.ELEMENT_ARRAY_BUFFER, faces);
  gl.bindVertexArray(null);
  const heights = [Infinity, -Infinity];
  for (let i = 2; i < vertices.length; i += 3) {
    heights[0] = Math.min(heights[0], vertices[i]);
    heights[1] = Math.max(heights[1], vertices[i]);
  }
  return { array, heights, count: faces.length };
}

// Samples of all runs, in pieces no shorter than is seen where all paths are.
function coarseOf({ first, place }) {
  let extent = 0;
  for (const k of [0, 1, 2]) {
    let [low, high] = [Infinity, -Infinity];
    for (let i = k; i < place.length; i += 3) [low, high] = [Math.min(low, place[i]), Math.max(high, place[i])];
    extent = Math.max(extent, high - low);
  }
  const coarse = [];
  for (let run = 0; run + 1 < first.length; run++) {
    let last = -1;
    for (let i = first[run]; i < first[run + 1]; i++) {
      const away = Math.hypot(...[0, 1, 2].map((k) => place[3 * i + k] - place[3 * last + k]));
      if (last >= 0 && away < extent / 300 && i + 1 < first[run + 1]) continue;
      coarse.push(i);
      last = i;
    }
  }
  return coarse;
}

// Where the coarse paths begin and end in the texture, after the samples.
function pathsOf(gl, samples) {
  const { first, place, speed, largest } = samples;
  const order = [...speed.keys(), ...coarseOf(samples)], ends = new Set(first.map((next) => next - 1));
  const rows = Math.max(Math.ceil(order.length / ROW), 1);
  const values = new Float32Array(4 * ROW * rows);
  order.forEach((i, k) => {
    const pace = speed[i] / largest;
    values.set([...place.subarray(3 * i, 3 * i + 3), ends.has(i) ? -1 - pace : pace], 4 * k);
  });
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, ROW, rows, 0, gl.RGBA, gl.FLOAT, values);
  return [speed.length, order.length];
}

// A function that draws points [m], one after the other in an array.
function pointsOf(gl) {
  const { program, uniforms, attribute } = built(gl, POINT), array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const buffer = buffered(gl, gl.ARRAY_BUFFER, new Float32Array());
  gl.enableVertexAttribArray(attribute("at"));
  gl.vertexAttribPointer(attribute("at"), 3, gl.FLOAT, false, 0, 0);
  gl.bindVertexArray(null);
  return (points, camera) => {
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.camera, false, camera.matrix);
    gl.uniform1f(uniforms.width, 11 * (window.devicePixelRatio || 1));
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, points, gl.DYNAMIC_DRAW);
    gl.disable(gl.DEPTH_TEST);
    gl.drawArrays(gl.POINTS, 0, points.length / 3);
    gl.enable(gl.DEPTH_TEST);
  };
}

// A function that draws a moment {camera, pose, run, all, bearing} and returns the number of
// triangles. Without samples there are no paths; of several runs `all` draws the paths of the
// others, too; `bearing` are points of contact [m], one after the other.
function drawingOf(gl, { terrain, rock, samples, radius, contour, grid = 0, colours }) {
  const mesh = built(gl, MESH), line = built(gl, LINE);
  const ground = meshOf(gl, mesh, terrain), stone = meshOf(gl, mesh, rock);
  const paths = samples && pathsOf(gl, samples), drawPoints = pointsOf(gl);
  let triangles = 0;
  gl.enable(gl.DEPTH_TEST);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);

  function drawMesh(shape, model, low, high, step) {
    gl.uniformMatrix4fv(mesh.uniforms.model, false, model);
    gl.uniform3fv(mesh.uniforms.low, low);
    gl.uniform3fv(mesh.uniforms.high, high);
    gl.uniform2fv(mesh.uniforms.heights, shape.heights);
    gl.uniform1f(mesh.uniforms.contour, step);
    gl.bindVertexArray(shape.array);
    gl.drawElements(gl.TRIANGLES, shape.count, gl.UNSIGNED_INT, 0);
    triangles += shape.count / 3;
  }

  function drawPaths(start, end, width, opacity, casing) {
    gl.uniform1i(line.uniforms.first, start);
    gl.uniform1f(line.uniforms.width, width * (window.devicePixelRatio || 1));
    gl.uniform1f(line.uniforms.opacity, opacity);
    gl.uniform1i(line.uniforms.casing, casing);
    gl.drawArrays(gl.TRIANGLES, 0, 6 * (end - start - 1));
    triangles += 2 * (end - start - 1);
  }

  return ({ camera, pose, run = null, all = false, bearing = [] }) => {
    const { width, height } = gl.canvas;
    triangles = 0;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.BLEND);
    gl.useProgram(mesh.program);
    gl.uniformMatrix4fv(mesh.uniforms.camera, false, camera.matrix);
    const [right, , back] = camera.axes; // the sun is behind the eye, to the left and above
    gl.uniform3fv(mesh.uniforms.sun, unit(add(add(back, right, -0.9), [0, 0, 0.9])));
    gl.uniform3fv(mesh.uniforms.rock, pose.position);
    gl.uniform1f(mesh.uniforms.radius, radius);
    gl.uniform1f(mesh.uniforms.grid, grid);
    drawMesh(ground, placed([0, 0, 0, 1], [0, 0, 0]), LOW, HIGH, contour);
    drawMesh(stone, placed(pose.quaternion, pose.position), ROCK, ROCK, 0);
    if (bearing.length) drawPoints(bearing, camera);
    if (run === null) return triangles;
    gl.useProgram(line.program);
    gl.bindVertexArray(null);
    gl.uniformMatrix4fv(line.uniforms.camera, false, camera.matrix);
    gl.uniform2f(line.uniforms.size, width, height);
    gl.uniform3fv(line.uniforms.stops, colours.flat());
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    const [start, end] = [samples.first[run], samples.first[run + 1]];
    if (all) drawPaths(...paths, 1.5, 0.7, false);
    drawPaths(start, end, 5.5, 1, true);
    drawPaths(start, end, 3, 1, false);
    gl.depthMask(true);
    return triangles;
  };
}
