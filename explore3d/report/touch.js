// Feel the object in the report's view: the pointer is the fingertip. What it crosses is heard (as the vibration that the
// crossing makes), seen as a strip of heights, and felt with a gamepad, if there is one. Nothing is fetched.
// The data are in #view-data: touch: [{axis: [x, y, z, ...], height, half}], lengths in the units of the view.
"use strict";

// ---- what needs no screen (tested by node) ----

const less = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const across = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// Where a ray first meets a mesh; null if it passes. (Moeller and Trumbore, 1997)
function meets(points, faces, origin, way) {
  let first = Infinity;
  const corner = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
  for (let i = 0; i < faces.length; i += 3) {
    const a = corner(faces[i]), u = less(corner(faces[i + 1]), a), v = less(corner(faces[i + 2]), a);
    const p = across(way, v), size = times(u, p);
    if (size === 0) continue;
    const from = less(origin, a), x = times(from, p) / size;
    if (x < 0 || x > 1) continue;
    const q = across(from, u), y = times(way, q) / size, t = times(v, q) / size;
    if (y >= 0 && x + y <= 1 && t > 0 && t < first) first = t;
  }
  return first < Infinity ? origin.map((each, i) => each + first * way[i]) : null;
}

// Distance of a place from an axis, a point or a polyline.
function off(place, axis) {
  let least = Math.hypot(...less(place, axis.slice(0, 3)));
  for (let i = 0; i + 5 < axis.length; i += 3) {
    const a = axis.slice(i, i + 3), leg = less(axis.slice(i + 3, i + 6), a), square = times(leg, leg);
    const share = square > 0 ? Math.min(Math.max(times(less(place, a), leg) / square, 0), 1) : 0;
    least = Math.min(least, Math.hypot(...less(place, a.map((each, k) => each + share * leg[k]))));
  }
  return least;
}

// Height of the fingertip there: of a crest H (1 - (d/w)^2), of a hollow H (1 - d/w)^2 (theory equation 4.10).
function heightAt(place, features) {
  let up = 0, down = 0;
  for (const each of features) {
    const u = off(place, each.axis) / each.half;
    if (u >= 1) continue;
    if (each.height > 0) up = Math.max(up, each.height * (1 - u * u));
    else down = Math.min(down, each.height * (1 - u) ** 2);
  }
  return up > 0 ? up : down;
}

// Heights at so many even places on the way from one place to another.
function crossed(from, to, features, count) {
  return Float32Array.from({ length: count }, (_, i) => {
    const share = count > 1 ? i / (count - 1) : 1;
    return heightAt(from.map((each, k) => each + share * (to[k] - each)), features);
  });
}

// The sound of heights that follow each other: their speed over the fastest that is told, softly limited.
function sound(heights, rate, fastest) {
  return Float32Array.from(heights, (each, i) => (i ? Math.tanh(((each - heights[i - 1]) * rate) / fastest) : 0));
}

// ---- the page ----

const STRIP = 300; // heights that the strip shows
const LATE = 0.03; // s that sounds are late, so that each begins where the one before ends
const QUICK = 0.05; // s in which the tallest feature is crossed at full volume

function feel(root, data, view) {
  const canvas = root.querySelector("canvas"), strip = root.querySelector("canvas.strip"), pen = strip.getContext("2d");
  const box = root.querySelector("input.feel"), features = data.touch;
  const tallest = Math.max(...features.map((each) => Math.abs(each.height)));
  const seen = [];
  let audio = null, last = null, ready = 0;
  const draw = () => {
    [strip.width, strip.height] = [strip.clientWidth, strip.clientHeight];
    pen.strokeStyle = "#1d4e89";
    pen.lineWidth = 1.5;
    pen.beginPath();
    const middle = 0.5 * strip.height, scale = (0.42 * strip.height) / tallest;
    seen.forEach((each, i) => pen.lineTo((i / STRIP) * strip.width, middle - scale * each));
    pen.stroke();
  };
  const play = (heights, seconds) => {
    const buffer = audio.createBuffer(1, heights.length, audio.sampleRate), source = audio.createBufferSource();
    buffer.copyToChannel(sound(heights, audio.sampleRate, tallest / QUICK), 0);
    source.buffer = buffer;
    source.connect(audio.destination);
    ready = Math.max(ready, audio.currentTime + LATE);
    source.start(ready);
    ready += seconds;
  };
  const rumble = (change, seconds) => {
    const strength = Math.min(1, (4 * Math.abs(change)) / tallest);
    for (const pad of navigator.getGamepads ? navigator.getGamepads() : []) {
      const motor = pad && pad.vibrationActuator;
      const effect = { duration: 1000 * seconds, strongMagnitude: strength, weakMagnitude: strength };
      if (motor && strength > 0.02) motor.playEffect("dual-rumble", effect);
    }
  };
  box.addEventListener("change", () => {
    strip.hidden = !box.checked;
    last = null;
    if (!box.checked) return;
    audio = audio || (window.AudioContext ? new AudioContext() : null);
    if (audio) audio.resume();
    draw();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!box.checked || event.buttons) return;
    const [origin, way] = view.ray(event.offsetX, event.offsetY);
    const place = meets(view.base.points, view.base.faces, origin, way), now = event.timeStamp;
    if (place && last) {
      const seconds = Math.min(Math.max((now - last.now) / 1000, 0.004), 0.1);
      const heights = crossed(last.place, place, features, Math.max(2, Math.round((audio ? audio.sampleRate : 1000) * seconds)));
      const ends = [heights[0], heights[heights.length - 1]];
      if (audio && now - last.now < 500) play(heights, seconds);
      rumble(ends[1] - ends[0], seconds);
      for (let i = 0; i < 4; i++) seen.push(heights[Math.floor((i / 3) * (heights.length - 1))]);
      seen.splice(0, Math.max(0, seen.length - STRIP));
      draw();
    }
    last = place ? { place, now } : null;
  });
  return { seen };
}

if (typeof document !== "undefined") {
  const given = JSON.parse(document.getElementById("view-data").textContent), view = window.explore3dView;
  if (view && given.touch.length) window.explore3dTouch = feel(document.getElementById("view"), given, view);
} else {
  module.exports = { meets, off, heightAt, crossed, sound };
}
