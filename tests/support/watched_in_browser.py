"""A real browser looks at a session, clicks each of its features, and says which ids came up and what it fetched."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from browser import PATIENCE, Browser

from explore3d.report.watch.view import Watch
from explore3d.scene.scene import load_scene
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import ObjectModel

SCENE = Path(__file__).resolve().parents[2] / "assets" / "scenes" / "mug.toml"
MIDDLE = "(() => { const r = document.querySelector('canvas').getBoundingClientRect();"
MIDDLE += " return [r.x + r.width / 2, r.y + r.height / 2]; })()"
# The viewer says that there is no graphics card, over a third of a small page: a click there does not reach the canvas
DISMISS = "(() => { const b = document.querySelector('.mantine-Notification-closeButton');"
DISMISS += " if (b) b.click(); return !!b; })()"
SMALL_PAGE = (800, 500)  # px: half the work of a larger one for a machine without a graphics card
HEADING = "(document.querySelector('h3') || {}).textContent"


@dataclass(frozen=True)
class Clicked:
    """Pairs of the feature that was clicked and the id that came up, and addresses that are not the view's own."""

    clicks: list[tuple[str, str]]
    outside: list[str]


def mug_with_features(folder: Path) -> None:
    """The mug's model as its author made it."""
    scene = load_scene(SCENE)
    base = Base(scene.base_surface())
    features = []
    for true in scene.truth:
        foot = base.foot(true.axis, scene.tip.radius)
        sizes = [Interval(each, each, each) for each in (true.height, true.width or 0.0, true.length or 0.0)]
        features.append(Feature(true.kind, foot.points, foot.normals, *sizes, Support(99.0, 9), True, 1e-5))
    ObjectModel.attach(base, features).save(folder)


def clicked_features(folder: Path, picture: Path | None = None) -> Clicked:
    """Click every feature of a session's model where the browser shows it.

    Args:
        folder: of the session.
        picture: PNG to be made of the page with the first feature chosen; None: none.
    """
    view = Watch(folder, port=0)
    try:
        view.look()
        with Browser(*SMALL_PAGE) as browser:
            browser.open(view.url)
            browser.until("!!document.querySelector('canvas')")
            browser.until(DISMISS, 20.0)  # a machine with a graphics card has nothing to say
            clicks = []
            for name in view.stage.features:
                clicks.append((name, _click(view, browser, name)))
                if picture is not None and len(clicks) == 1:
                    time.sleep(2.0)
                    picture.write_bytes(browser.picture())
            own = (view.url, view.url.replace("http", "ws"), "data:", "blob:", "about:")
            return Clicked(clicks, [each for each in browser.fetched if not each.startswith(own)])
    finally:
        view.close()


def _click(view: Watch, browser: Browser, name: str) -> str:
    """Turn the camera to the feature, click where it is seen, and read the panel's heading.

    A busy browser turns its camera later than it is told: what it then picks is what it still looks at, so the click is
    made again until the patience ends.
    """
    heading = ""
    deadline = time.monotonic() + PATIENCE
    while heading != name and time.monotonic() < deadline:
        view.choose(None)
        browser.until(f"!{HEADING}")  # that of the last one is gone
        view.stage.look_at(name)
        time.sleep(1.0)
        browser.click(*browser.ask(MIDDLE))
        heading = str(browser.until(HEADING, 10.0) or "")
    return heading
