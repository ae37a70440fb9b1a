"""The report's view in a real browser: what the pointer crosses is heard, seen, and felt with a gamepad."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import Browser, chromium

from explore3d.report.view3d import object_view
from mapping import Feature, Interval, ObjectModel, Support, Surface
from mapping.base import Base

PLATE = Surface(0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
TIP = 10e-3
# What is played and what the motors are told is noted; the browser of a test has no gamepad of its own
SPIES = """
window.heard = []; window.rumbled = [];
const start = AudioBufferSourceNode.prototype.start;
AudioBufferSourceNode.prototype.start = function (when) {
  window.heard.push(Math.max(...this.buffer.getChannelData(0).map(Math.abs)));
  return start.call(this, when);
};
navigator.getGamepads = () => [{ vibrationActuator: { playEffect: (kind, effect) => window.rumbled.push(effect) } }];
"""


def page() -> str:
    """A plate with a wire along y, as the report shows it."""
    axis = np.array([[0.0, -20e-3, 0.0], [0.0, 20e-3, 0.0]])
    sizes = [Interval(each, each, each) for each in (0.65e-3, 0.65e-3, 40e-3)]
    wire = Feature("ridge", axis, np.tile([0.0, 0.0, 1.0], (2, 1)), *sizes, Support(99.0, 9), True, 1e-5)
    features = ObjectModel.attach(Base(PLATE), [wire]).features
    return f"<!doctype html><html><body>{object_view(PLATE, features, [], TIP)}</body></html>"


@pytest.mark.slow
def test_what_the_pointer_crosses_is_heard_seen_and_felt(tmp_path: Path) -> None:
    if chromium() is None:
        pytest.skip("no Chromium")
    file = tmp_path / "view.html"
    file.write_text(page(), encoding="utf-8")
    with Browser() as browser:
        browser.tell("Page.addScriptToEvaluateOnNewDocument", source=SPIES)
        browser.open(file.as_uri())
        assert browser.until("!!window.explore3dTouch")
        place = "(name => { const r = document.querySelector(name).getBoundingClientRect();"
        place += " return [r.x, r.y, r.width, r.height]; })"
        left, top, width, height = browser.ask(f"{place}('input.feel')")
        browser.click(left + 0.5 * width, top + 0.5 * height)
        assert browser.ask("document.querySelector('input.feel').checked")
        assert browser.ask("!document.querySelector('canvas.strip').hidden")
        left, top, width, height = browser.ask(f"{place}('#view canvas')")
        for share in np.linspace(0.2, 0.8, 60):  # straight over the middle of the plate, and of the wire
            browser.tell("Input.dispatchMouseEvent", type="mouseMoved", x=left + share * width, y=top + 0.5 * height)
        seen = np.array(browser.ask("[...window.explore3dTouch.seen]"))
        heard, rumbled = browser.ask("window.heard"), browser.ask("window.rumbled")
        drawn = browser.ask(
            "(() => { const c = document.querySelector('canvas.strip');"
            " return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((each) => each > 0); })()"
        )
        assert browser.complaints == []
    assert seen.max() > 0.3 * 0.65e-3 and seen.min() == 0.0  # flat, up, and down again
    assert max(heard) > 0.01 and min(heard) == 0.0
    assert max(each["strongMagnitude"] for each in rumbled) > 0.02
    assert drawn
    assert browser.fetched == [file.as_uri()]
