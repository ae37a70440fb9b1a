// The report's view of the object: a mesh, the sweeps and the features in WebGL2, to be turned by hand.
// Nothing is fetched. The data are JSON in the element #view-data, arrays in base64:
//   box: [low, high] of all that is shown; unit, factor: of the scale bar, units per metre; eye: direction of the camera
//   meshes: [{layer, id, colour, low, span, points (uint16 x 3), faces (uint32 x 3), text, outward}]
//   lines: [{layer, colour, width, low, span, points (uint16 x 3), starts}]
"use strict";

// ---- what needs no screen (tested by node) ----

function bytes(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

// Points (N x 3) in the data's units from 16 bit shares of a box.
function places(part) {
  const shares = new Uint16Array(bytes(part.points).buffer);
  return Float32Array.from(shares, (share, i) => part.low[i % 3] + (part.span[i % 3] * share) / 65535);
}

// Straight pieces (M x 6) of polylines that begin at the given points.
function pieces(points, starts) {
  const ends = new Set(starts.map((start) => start - 1));
  const found = [];
  for (let i = 0; i + 1 < points.length / 3; i++) {
    if (!ends.has(i)) found.push(...points.subarray(3 * i, 3 * i + 6));
  }
  return new Float32Array(found);
}

const minus = (a, b) => a.map((each, i) => each - b[i]);
const dot = (a, b) => a.reduce((sum, each, i) => sum + each * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((each) => each / Math.hypot(...a));

// The camera's unit vectors to the right, up, and back towards it, from the two angles of a turntable about z.
function frame(yaw, pitch) {
  const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  return [right, cross(back, right), back];
}

// Column-major matrix from the object to clip space.
function matrix(camera, aspect) {
  const [right, up, back] = frame(camera.yaw, camera.pitch);
  const focal = 1 / Math.tan(0.5 * FIELD);
  const eye = camera.target.map((each, i) => each + camera.distance * back[i]);
  const near = 0.01 * camera.distance, far = camera.distance + 4 * camera.size;
  const depth = (far + near) / (near - far), shift = (2 * far * near) / (near - far);
  const rows = [
    [...right.map((each) => (each * focal) / aspect), (-dot(right, eye) * focal) / aspect],
    [...up.map((each) => each * focal), -dot(up, eye) * focal],
    [...back.map((each) => each * depth), -dot(back, eye) * depth + shift],
    [...back.map((each) => -each), dot(back, eye)],
  ];
  return Float32Array.from({ length: 16 }, (_, i) => rows[i % 4][Math.floor(i / 4)]);
}

// From where and in which direction a place of the canvas (shares of it, from the upper left) is looked at.
function ray(camera, aspect, x, y) {
  const [right, up, back] = frame(camera.yaw, camera.pitch), half = Math.tan(0.5 * FIELD);
  const [aside, above] = [(2 * x - 1) * half * aspect, (1 - 2 * y) * half];
  return [
    camera.target.map((each, i) => each + camera.distance * back[i]),
    back.map((each, i) => aside * right[i] + above * up[i] - each),
  ];
}

// Where a point is seen, px from the upper left corner; null behind the camera.
function seenAt(point, m, width, height) {
  const clip = [0, 1, 3].map((row) => m[row] * point[0] + m[4 + row] * point[1] + m[8 + row] * point[2] + m[12 + row]);
  return clip[2] > 0 ? [(0.5 + (0.5 * clip[0]) / clip[2]) * width, (0.5 - (0.5 * clip[1]) / clip[2]) * height] : null;
}

// A camera from which the whole box is in view.
function overview(data, aspect) {
  const [low, high] = data.box;
  const eye = unit(data.eye), yaw = Math.atan2(eye[1], eye[0]), pitch = Math.asin(eye[2]);
  const target = low.map((each, i) => 0.5 * (each + high[i]));
  const [right, up, back] = frame(yaw, pitch), half = Math.tan(0.5 * FIELD) / MARGIN;
  const needs = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
    const from = minus(low.map((each, i) => (corner & (1 << i) ? high[i] : each)), target);
    return dot(from, back) + Math.max(Math.abs(dot(from, up)), Math.abs(dot(from, right)) / aspect) / half;
  });
  return { target, size: Math.hypot(...minus(high, low)), distance: Math.max(...needs), yaw, pitch };
}

// The longest of 1, 2, 5 times a power of ten that is no longer than `most`.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((step) => step * power <= most);
}

const FIELD = 0.5; // rad, the vertical field of view
const MARGIN = 1.06; // of the first view around the object
const STEEPEST = 0.499 * Math.PI;
const FACING = 0.3; // cosine: what is turned away from the camera further than this is not seen well
const ASIDE = 0.35; // rad: relief shows from a little aside
const REACH = 6; // px beside a feature that still pick it

// ---- the page ----

function show(root, data) {
  const canvas = root.querySelector("canvas"), label = root.querySelector(".label"), bar = root.querySelector(".scale");
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) {
    label.textContent = "This browser has no WebGL2: the picture above shows the same.";
    label.hidden = false;
    return null;
  }
  const shader = (vertex, fragment) => {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const part = gl.createShader(kind);
      gl.shaderSource(part, "#version 300 es\nprecision highp float;\n" + source);
      gl.compileShader(part);
      gl.attachShader(program, part);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return (name) => (name ? gl.getUniformLocation(program, name) : program);
  };
  // Flat faces, lit from the upper left behind the camera, as in the still picture
  const solid = shader(
    `layout(location=0) in vec3 place; uniform mat4 m; out vec3 p;
     void main() { p = place; gl_Position = m * vec4(place, 1); }`,
    `in vec3 p; uniform vec3 colour, light, back; uniform float flat_; out vec4 result;
     void main() {
       vec3 n = normalize(cross(dFdx(p), dFdy(p)));
       if (dot(n, back) < 0.0) n = -n;
       result = vec4(flat_ > 0.0 ? colour : min(colour * (0.55 + 0.5 * max(dot(n, light), 0.0)), 1.0), 1);
     }`,
  );
  // Lines so many px wide: each piece is a rectangle in the screen, a little nearer than what it lies on
  const thin = shader(
    `layout(location=0) in vec3 a; layout(location=1) in vec3 b; uniform mat4 m; uniform vec2 px; uniform float width;
     void main() {
       vec4 p = m * vec4(a, 1), q = m * vec4(b, 1);
       vec2 along = (q.xy / q.w - p.xy / p.w) * px;
       vec2 side = length(along) > 0.0 ? normalize(vec2(-along.y, along.x)) : vec2(0);
       gl_Position = gl_VertexID < 2 ? p : q;
       gl_Position.xy += (gl_VertexID % 2 == 0 ? 1.0 : -1.0) * 0.5 * width * side / px * gl_Position.w * 2.0;
       gl_Position.z -= 2e-4 * gl_Position.w;
     }`,
    `uniform vec3 colour; out vec4 result; void main() { result = vec4(colour, 1); }`,
  );
  const buffer = (target, values) => {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, values, gl.STATIC_DRAW);
  };
  const meshes = data.meshes.map((part) => {
    const array = gl.createVertexArray(), faces = new Uint32Array(bytes(part.faces).buffer), points = places(part);
    gl.bindVertexArray(array);
    buffer(gl.ARRAY_BUFFER, points);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    buffer(gl.ELEMENT_ARRAY_BUFFER, faces);
    return { ...part, array, count: faces.length, points, faces };
  });
  const lines = data.lines.map((part) => {
    const array = gl.createVertexArray(), ends = pieces(places(part), part.starts);
    gl.bindVertexArray(array);
    buffer(gl.ARRAY_BUFFER, ends);
    for (const i of [0, 1]) {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 24, 12 * i);
      gl.vertexAttribDivisor(i, 1);
    }
    return { ...part, array, count: ends.length / 6 };
  });
  const features = meshes.filter((part) => part.id);
  const hidden = new Set();
  let camera, chosen = null, waiting = true; // until the page itself is on the screen

  const m = () => matrix(camera, canvas.width / canvas.height);
  const meshesOf = (picking) => {
    const [right, up, back] = frame(camera.yaw, camera.pitch);
    gl.useProgram(solid());
    gl.uniformMatrix4fv(solid("m"), false, m());
    gl.uniform3fv(solid("back"), back);
    // from above, seen from below from below: else what is turned down lies in the shadow (as in pictures/render.py)
    const above = 0.65 * Math.min(Math.max(back[2] / 0.4, -1), 1);
    gl.uniform3fv(solid("light"), unit(back.map((each, i) => each - 0.45 * right[i] + above * up[i])));
    gl.uniform1f(solid("flat_"), picking ? 1 : 0);
    for (const part of meshes.filter((each) => !hidden.has(each.layer))) {
      const number = 1 + features.indexOf(part);
      const named = [(number & 255) / 255, (number >> 8) / 255, 0];
      gl.uniform3fv(solid("colour"), picking ? named : part.id && part.id === chosen ? [1, 0.76, 0.03] : part.colour);
      gl.bindVertexArray(part.array);
      gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
    }
  };
  // The page's own ground, which is dark where the reader wants that
  const paper = () => getComputedStyle(document.body).backgroundColor.match(/[\d.]+/g).slice(0, 3).map((v) => v / 255);
  const draw = () => {
    waiting = false;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    [canvas.width, canvas.height] = [Math.round(ratio * width), Math.round(ratio * height)];
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(...paper(), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    meshesOf(false);
    gl.useProgram(thin());
    gl.uniformMatrix4fv(thin("m"), false, m());
    gl.uniform2f(thin("px"), canvas.width, canvas.height);
    for (const part of lines.filter((each) => !hidden.has(each.layer))) {
      gl.uniform3fv(thin("colour"), part.colour);
      gl.uniform1f(thin("width"), ratio * part.width);
      gl.bindVertexArray(part.array);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, part.count);
    }
    // the unit that the reader chose, else the one that fits
    const lengths = window.explore3dLengths, unit = (lengths && lengths.unit) || data.unit;
    const factor = lengths && lengths.unit ? 1 / lengths.metres : data.factor;
    const perPixel = (2 * Math.tan(0.5 * FIELD) * camera.distance) / height;
    const length = roundLength(0.2 * width * perPixel * factor);
    bar.style.width = `${length / factor / perPixel}px`;
    bar.textContent = `${+length.toPrecision(3)} ${unit}`;
    place(width, height);
  };
  const redraw = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const lengthsOf = (text) => (window.explore3dLengths ? window.explore3dLengths.text(text) : text);
  // The chosen feature's name and sizes, beside it
  const place = (width, height) => {
    const part = features.find((each) => each.id === chosen);
    const at = part && seenAt(part.low.map((each, i) => each + 0.5 * part.span[i]), m(), width, height);
    label.hidden = !at;
    if (!at) return;
    label.textContent = lengthsOf(part.text.join("\n"));
    label.style.left = `${Math.min(Math.max(at[0] + 14, 4), width - label.offsetWidth - 4)}px`;
    label.style.top = `${Math.min(Math.max(at[1] - label.offsetHeight - 14, 4), height - label.offsetHeight - 4)}px`;
  };
  // The feature at a place of the canvas, or within REACH px of it
  const target = gl.createFramebuffer(), colours = gl.createTexture(), depths = gl.createRenderbuffer();
  const pick = (x, y) => {
    const [width, height, ratio] = [canvas.width, canvas.height, canvas.width / canvas.clientWidth];
    gl.bindTexture(gl.TEXTURE_2D, colours);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.bindRenderbuffer(gl.RENDERBUFFER, depths);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colours, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depths);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    meshesOf(true);
    const reach = Math.round(ratio * REACH), side = 2 * reach + 1, found = new Uint8Array(4 * side * side);
    const [column, row] = [Math.round(ratio * x) - reach, height - 1 - Math.round(ratio * y) - reach];
    gl.readPixels(column, row, side, side, gl.RGBA, gl.UNSIGNED_BYTE, found);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let best = null, nearest = Infinity;
    for (let i = 0; i < side * side; i++) {
      const number = found[4 * i] + 256 * found[4 * i + 1];
      const away = Math.hypot((i % side) - reach, Math.floor(i / side) - reach);
      if (number && away < nearest) [best, nearest] = [features[number - 1].id, away];
    }
    return best;
  };
  const rows = new Map([...document.querySelectorAll("[data-feature]")].map((each) => [each.dataset.feature, each]));
  const choose = (id, scroll) => {
    chosen = id;
    for (const [name, button] of rows) {
      button.setAttribute("aria-pressed", name === id);
      button.closest("tr").classList.toggle("chosen", name === id);
    }
    const row = rows.get(id);
    const box = row && row.closest(".table");
    if (box && scroll) box.scrollTop = row.closest("tr").offsetTop - 0.5 * box.clientHeight;
    redraw();
  };
  for (const [name, button] of rows) {
    button.addEventListener("click", () => {
      choose(name === chosen ? null : name, false);
      if (chosen) turnTo(features.find((each) => each.id === chosen).outward);
      root.scrollIntoView({ block: "nearest" });
    });
  }
  for (const input of root.querySelectorAll("input[data-layer]")) {
    input.addEventListener("change", () => {
      if (input.checked) hidden.delete(input.dataset.layer);
      else hidden.add(input.dataset.layer);
      redraw();
    });
  }
  const turn = (dx, dy) => {
    camera.yaw -= dx;
    camera.pitch = Math.min(Math.max(camera.pitch + dy, -STEEPEST), STEEPEST);
    redraw();
  };
  // What lies on the far side is turned to the front
  const turnTo = (outward) => {
    const size = Math.hypot(...outward), back = frame(camera.yaw, camera.pitch)[2];
    if (!size || dot(outward, back) > FACING * size) return;
    camera.yaw = Math.atan2(outward[1], outward[0]) + ASIDE;
    camera.pitch = Math.min(Math.asin(outward[2] / size) + ASIDE, STEEPEST);
    redraw();
  };
  const shift = (dx, dy) => {
    const [right, up] = frame(camera.yaw, camera.pitch);
    const scale = (2 * Math.tan(0.5 * FIELD) * camera.distance) / canvas.clientHeight;
    camera.target = camera.target.map((each, i) => each - scale * (dx * right[i] - dy * up[i]));
    redraw();
  };
  const zoom = (factor) => {
    camera.distance = Math.min(Math.max(camera.distance * factor, 1e-3 * camera.size), 20 * camera.size);
    redraw();
  };
  const reset = () => {
    camera = overview(data, canvas.clientWidth / Math.max(canvas.clientHeight, 1));
    redraw();
  };
  const step = (by) => {
    const ids = features.map((each) => each.id);
    if (!ids.length) return;
    choose(ids[(ids.indexOf(chosen) + by + ids.length + (chosen || by > 0 ? 0 : 1)) % ids.length], true);
    turnTo(features.find((each) => each.id === chosen).outward);
  };

  const fingers = new Map();
  let moved = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY], [dx, dy] = minus(now, before);
    moved += Math.hypot(dx, dy);
    fingers.set(event.pointerId, now);
    const others = [...fingers].filter(([id]) => id !== event.pointerId);
    if (others.length) {
      zoom(Math.hypot(...minus(before, others[0][1])) / Math.max(Math.hypot(...minus(now, others[0][1])), 1));
      shift(0.5 * dx, 0.5 * dy);
    } else if (event.shiftKey || event.buttons & 6) shift(dx, dy);
    else turn(0.008 * dx, 0.008 * dy);
  });
  canvas.addEventListener("pointerup", (event) => {
    fingers.delete(event.pointerId);
    if (moved < 4) choose(pick(event.offsetX, event.offsetY), true);
  });
  canvas.addEventListener("pointercancel", (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(0.0015 * event.deltaY));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1),
    ArrowDown: () => turn(0, -0.1), "+": () => zoom(0.85), "-": () => zoom(1 / 0.85), 0: reset, n: () => step(1),
    p: () => step(-1), Escape: () => choose(null, false),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  root.querySelector("button.reset").addEventListener("click", reset);
  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  reset();
  requestAnimationFrame(() => setTimeout(draw));
  const looked = (x, y) => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    return ray(camera, width / height, x / width, y / height);
  };
  window.addEventListener("explore3d-unit", redraw);
  return { choose, step, pick, ray: looked, base: meshes.find((part) => !part.id), at: (id) => centreOf(features.find((each) => each.id === id)) };

  function centreOf(part) {
    const middle = part.low.map((each, i) => each + 0.5 * part.span[i]);
    return seenAt(middle, m(), canvas.clientWidth, canvas.clientHeight);
  }
}

if (typeof document !== "undefined") {
  const root = document.getElementById("view");
  window.explore3dView = show(root, JSON.parse(document.getElementById("view-data").textContent));
} else {
  module.exports = { bytes, places, pieces, frame, matrix, ray, seenAt, overview, roundLength };
}
