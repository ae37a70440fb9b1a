// The report's view of a profile: height against place, to be zoomed by hand. Nothing is fetched.
// The data are JSON in the element #view-data: x, y (float32 in base64), x_name, y_name,
// features: [{id, x, y, text}].
"use strict";

// ---- what needs no screen (tested by node) ----

function floats(base64) {
  return new Float32Array(Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer);
}

// The first index whose x is not below a value; x rises.
function firstFrom(x, value) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

// Round places between two values, about `most` of them, and the digits that they need.
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((each) => each * power >= rough * (1 - 1e-9));
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= high / step + 1e-9; i++) found.push([i * step, (i * step).toFixed(digits)]);
  return found;
}

// The range of a line between two of its points (both in), and a little air.
function range(y, first, last) {
  let low = Infinity, high = -Infinity;
  for (let i = first; i < last; i++) [low, high] = [Math.min(low, y[i]), Math.max(high, y[i])];
  if (!(high > low)) return Number.isFinite(low) ? [low - 1, low + 1] : [0, 1];
  return [low - 0.06 * (high - low), high + 0.12 * (high - low)];
}

// ---- the page ----

function show(root, data) {
  const canvas = root.querySelector("canvas"), label = root.querySelector(".label"), pen = canvas.getContext("2d");
  const x = floats(data.x), y = floats(data.y), all = [x[0], x[x.length - 1]];
  const edge = { left: 66, right: 14, top: 12, bottom: 44 };
  let span = [...all], chosen = null, waiting = false, heights = [0, 1];
  const wide = () => canvas.clientWidth - edge.left - edge.right;
  const high = () => canvas.clientHeight - edge.top - edge.bottom;
  const right = (value) => edge.left + ((value - span[0]) / (span[1] - span[0])) * wide();
  const down = (value) => edge.top + (1 - (value - heights[0]) / (heights[1] - heights[0])) * high();

  const draw = () => {
    waiting = false;
    const ratio = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [ratio * canvas.clientWidth, ratio * canvas.clientHeight];
    pen.scale(ratio, ratio);
    const first = Math.max(0, firstFrom(x, span[0]) - 1), last = Math.min(x.length, firstFrom(x, span[1]) + 2);
    heights = range(y, first, last);
    pen.font = "12px system-ui, sans-serif";
    const style = getComputedStyle(document.documentElement);
    pen.strokeStyle = style.getPropertyValue("--faint");
    pen.fillStyle = style.getPropertyValue("--ink");
    pen.textAlign = "center";
    for (const [place, word] of ticks(...span, 8)) {
      pen.strokeRect(right(place), edge.top, 0, high());
      pen.fillText(word, right(place), edge.top + high() + 16);
    }
    pen.textAlign = "right";
    for (const [place, word] of ticks(...heights, 6)) {
      pen.strokeRect(edge.left, down(place), wide(), 0);
      pen.fillText(word, edge.left - 6, down(place) + 4);
    }
    pen.textAlign = "center";
    pen.fillText(data.x_name, edge.left + 0.5 * wide(), canvas.clientHeight - 8);
    pen.save();
    pen.rotate(-0.5 * Math.PI);
    pen.fillText(data.y_name, -(edge.top + 0.5 * high()), 12);
    pen.restore();
    pen.save();
    pen.beginPath();
    pen.rect(edge.left, edge.top, wide(), high());
    pen.clip();
    // Where many points share a column of pixels, its lowest and highest are drawn: the same line, quickly
    pen.strokeStyle = "#829ab1";
    pen.beginPath();
    const block = Math.max(1, Math.floor((last - first) / (4 * wide())));
    for (let i = first; i < last; i += block) {
      let [low, top] = [y[i], y[i]];
      for (let k = i; k < Math.min(i + block, last); k++) [low, top] = [Math.min(low, y[k]), Math.max(top, y[k])];
      pen.lineTo(right(x[i]), down(low));
      if (top > low) pen.lineTo(right(x[i]), down(top));
    }
    pen.stroke();
    for (const each of data.features) {
      const [column, row] = [right(each.x), down(each.y) - 4];
      pen.fillStyle = pen.strokeStyle = each.id === chosen ? "#ffc107" : "#c62828";
      pen.beginPath();
      pen.moveTo(column, row);
      pen.lineTo(column - 5, row - 9);
      pen.lineTo(column + 5, row - 9);
      pen.closePath();
      if (each.finer) pen.fill();
      pen.stroke();
    }
    pen.restore();
    const part = data.features.find((each) => each.id === chosen);
    label.hidden = !part || part.x < span[0] || part.x > span[1];
    if (label.hidden) return;
    const text = part.text.join("\n");
    label.textContent = window.explore3dLengths ? window.explore3dLengths.text(text) : text;
    label.style.left = `${Math.min(right(part.x) + 12, canvas.clientWidth - label.offsetWidth - 4)}px`;
    label.style.top = `${edge.top + 4}px`;
  };
  const redraw = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const rows = new Map([...document.querySelectorAll("[data-feature]")].map((each) => [each.dataset.feature, each]));
  const choose = (id, scroll) => {
    chosen = id;
    for (const [name, button] of rows) {
      button.setAttribute("aria-pressed", name === id);
      button.closest("tr").classList.toggle("chosen", name === id);
    }
    const row = rows.get(id), box = row && row.closest(".table");
    if (box && scroll) box.scrollTop = row.closest("tr").offsetTop - 0.5 * box.clientHeight;
    redraw();
  };
  const zoom = (factor, about) => {
    const width = Math.min((span[1] - span[0]) * factor, all[1] - all[0]);
    if (width < 1e-6 * (all[1] - all[0])) return;
    const share = (about - span[0]) / (span[1] - span[0]);
    const start = Math.min(Math.max(about - share * width, all[0]), all[1] - width);
    span = [start, start + width];
    redraw();
  };
  const shift = (by) => {
    const width = span[1] - span[0], start = Math.min(Math.max(span[0] + by, all[0]), all[1] - width);
    span = [start, start + width];
    redraw();
  };
  const reset = () => {
    span = [...all];
    redraw();
  };
  const pick = (column, row) => {
    const away = (each) => Math.hypot(right(each.x) - column, down(each.y) - 8 - row);
    const near = data.features.filter((each) => away(each) < 14).sort((a, b) => away(a) - away(b));
    return near.length ? near[0].id : null;
  };
  const valueAt = (column) => span[0] + ((column - edge.left) / wide()) * (span[1] - span[0]);
  for (const [name, button] of rows) {
    button.addEventListener("click", () => {
      choose(name === chosen ? null : name, false);
      root.scrollIntoView({ block: "nearest" });
    });
  }
  let held = null, moved = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    [held, moved] = [event.offsetX, 0];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (held === null) return;
    moved += Math.abs(event.offsetX - held);
    shift(valueAt(held) - valueAt(event.offsetX));
    held = event.offsetX;
  });
  canvas.addEventListener("pointerup", (event) => {
    held = null;
    if (moved < 4) choose(pick(event.offsetX, event.offsetY), true);
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(0.0015 * event.deltaY), valueAt(event.offsetX));
  }, { passive: false });
  const middle = () => 0.5 * (span[0] + span[1]);
  const step = (by) => {
    const ids = data.features.map((each) => each.id);
    if (ids.length) choose(ids[(ids.indexOf(chosen) + by + ids.length + (chosen || by > 0 ? 0 : 1)) % ids.length], true);
  };
  const keys = {
    ArrowLeft: () => shift(-0.1 * (span[1] - span[0])), ArrowRight: () => shift(0.1 * (span[1] - span[0])),
    "+": () => zoom(0.8, middle()), "-": () => zoom(1.25, middle()), 0: reset, n: () => step(1), p: () => step(-1),
    Escape: () => choose(null, false),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
  root.querySelector("button.reset").addEventListener("click", reset);
  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  draw();
  window.addEventListener("explore3d-unit", redraw);
  return { choose, step, pick };
}

if (typeof document !== "undefined") {
  const root = document.getElementById("view");
  window.explore3dView = show(root, JSON.parse(document.getElementById("view-data").textContent));
} else {
  module.exports = { floats, firstFrom, ticks, range };
}
