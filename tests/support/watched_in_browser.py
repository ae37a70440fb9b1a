"""A real browser looks at a session, clicks each of its features, and says which ids came up and what it fetched."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from explore3d.report.watch.view import Watch
from explore3d.scene.scene import load_scene
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import ObjectModel

PATIENCE = 240.0  # s, on a busy machine without a graphics card
SCENE = Path(__file__).resolve().parents[2] / "assets" / "scenes" / "mug.toml"
OPTIONS = ("--headless=new", "--no-sandbox", "--window-size=1000,700", "--use-gl=angle", "--use-angle=swiftshader")
OPTIONS += ("--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update")


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


def clicked_features(folder: Path) -> Clicked | None:
    """Click every feature of a session's model where the browser shows it; None without a browser."""
    if shutil.which("chromedriver") is None or shutil.which("chromium") is None:
        return None
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    for each in OPTIONS:
        options.add_argument(each)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL"})
    view = Watch(folder, port=0)
    view.look()
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    try:
        driver.set_page_load_timeout(PATIENCE)
        driver.get(view.url)
        clicks = [(name, _click(view, driver, name)) for name in view.stage.features]
        return Clicked(clicks, _outside(driver, view.url))
    finally:
        driver.quit()
        view.close()


def _click(view: Watch, driver: Any, name: str) -> str:
    """Turn the camera to the feature, click where it is seen, and read the panel's heading."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    view.choose(None)
    _until(lambda: bool(view.server.get_clients()))
    canvas = driver.find_element(By.TAG_NAME, "canvas")
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        view.stage.look_at(name)
        time.sleep(1.0)
        ActionChains(driver).move_to_element(canvas).click().perform()
        for _ in range(10):
            headings = [each.text for each in driver.find_elements(By.TAG_NAME, "h3")]
            if headings:
                return str(headings[0])
            time.sleep(0.3)
    return ""


def _outside(driver: Any, own: str) -> list[str]:
    """Addresses that the page asked for beside the view's server."""
    found = []
    for entry in driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            url = message["params"]["request"]["url"]
            if not url.startswith((own, "data:", "blob:", "chrome")):
                found.append(url)
    return found


def _until(holds: Any) -> None:
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline, "the browser never came"
        time.sleep(0.2)
