"""Found, missed and invented are said only where the truth is known."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from explore3d.analysis.method import Work
from explore3d.analysis.result import Analysis
from explore3d.analysis.stages import Stages
from explore3d.analysis.truth import Comparison, TrueFeature
from explore3d.log.own.record import Log
from explore3d.report.evidence import compared_with_truth
from explore3d.report.pictures import Pictures
from explore3d.scene.finger import GivenFingerTable
from explore3d.scene.scene import Scene, parse_scene
from mapping.trace import Trace

WIRE = Path(__file__).parents[3] / "assets" / "scenes" / "wire_on_plate.toml"
LOG = Log(Trace(np.arange(3.0), np.zeros((3, 3)), np.zeros(3, dtype=np.int64), 1e-2))


def scene(name: str = "wire_on_plate", truth: bool = True) -> Scene:
    path = WIRE.with_name(f"{name}.toml")
    text = path.read_text()
    return parse_scene(text if truth else text[: text.index("[[truth]]")], path)


def known(scene: Scene | None) -> bool:
    return Work(LOG, scene, None, Stages()).truth_known


def test_a_stated_truth_is_known_whoever_touched_it() -> None:
    assert known(scene()) and known(scene().with_finger(GivenFingerTable()))


def test_a_simulated_finger_on_the_very_model_meets_nothing_else() -> None:
    assert known(scene("empty_plate"))


def test_of_an_object_whose_details_nobody_states_no_truth_is_known() -> None:
    assert not known(scene(truth=False))
    assert not known(scene("empty_plate").with_finger(GivenFingerTable()))
    assert not known(None)


@pytest.mark.parametrize(("given", "why"), [(False, "The object is simulated"), (True, "The scene states the truth")])
def test_only_a_simulated_object_is_called_simulated(given: bool, why: str) -> None:
    true = TrueFeature("ridge", np.zeros((1, 3)), 1e-3)
    stated = scene().with_finger(GivenFingerTable()) if given else scene()
    found = SimpleNamespace(scene=stated, truth=(true,), errors=(Comparison("missed", true),))
    page = compared_with_truth(cast(Analysis, found), Pictures({}))
    assert why in page and "0 of 1 features found, 1 missed, 0 invented" in page
