// Lengths of the page in the unit that the reader chooses. Pictures and the scene's own text keep theirs.
"use strict";

// ---- what needs no screen (tested by node) ----

const METRES = { m: 1, mm: 1e-3, "µm": 1e-6, nm: 1e-9, in: 0.0254, mil: 2.54e-5 };
const NUMBER = "[+−-]?\\d+(?:\\.\\d+)?";
const SEVERAL = `(?:${NUMBER}(?:, | to | and ))*${NUMBER}`;
// One number or several ("0.64 to 0.66 mm", "1.0, 2.0, 3.0 mm") and their unit, with the range that may stand behind it
// in brackets without one ("0.65 mm (0.64 to 0.66)"); no speeds, areas or ends of names
const LENGTH = new RegExp(`(?<![\\w.,−-])(${SEVERAL}) (m|mm|µm|nm)(?![\\w/²³])( \\(${NUMBER} to ${NUMBER}\\))?`, "gu");

// A number in another unit, to as many digits as it had, or one more where the units' ratio is no power of ten.
function converted(number, from, to) {
  const places = (number.split(".")[1] || "").length, ratio = METRES[to] / METRES[from];
  const digits = Math.min(Math.max(places + Math.ceil(Math.log10(ratio) - 1e-9), 0), 15);
  return (number.startsWith("+") ? "+" : "") + (Number(number.replace("−", "-")) / ratio).toFixed(digits);
}

const all = (numbers, from, to) => numbers.replace(new RegExp(NUMBER, "gu"), (each) => converted(each, from, to));

// A text with all its lengths in one unit; with `from`, bare numbers of that unit; without `to`, as it is.
function inUnit(text, to, from) {
  if (!to) return text;
  const written = (_, numbers, unit, range) => `${all(numbers, unit, to)} ${to}${range ? all(range, unit, to) : ""}`;
  return from ? all(text, from, to) : text.replace(LENGTH, written);
}

// ---- the page ----

function offer(select) {
  const walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  const places = [];
  while (walker.nextNode()) {
    const node = walker.currentNode, parent = node.parentElement;
    if (parent.closest("pre, code, svg, script, select, .view")) continue;
    const bare = parent.dataset.unit;
    if (bare || node.data.search(LENGTH) >= 0) places.push([node, node.data, bare]);
  }
  const say = () => {
    for (const [node, text, bare] of places) node.data = inUnit(text, select.value, bare);
    window.explore3dLengths = { text: (text) => inUnit(text, select.value), unit: select.value, metres: METRES[select.value] };
    window.dispatchEvent(new Event("explore3d-unit"));
  };
  select.addEventListener("change", say);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, select, textarea")) return;
    const steps = { n: 1, p: -1 };
    if (event.key === "u") {
      select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
      say();
    } else if (steps[event.key] && window.explore3dView && window.explore3dView.step && !event.defaultPrevented) {
      window.explore3dView.step(steps[event.key]);
    }
  });
}

if (typeof document !== "undefined") offer(document.getElementById("unit"));
else module.exports = { converted, inUnit };
