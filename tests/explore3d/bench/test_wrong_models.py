"""The judge of poses: what a pose says it does not know counts for nothing, everything else for what it is."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.scenes.exploring import BenchScene
from explore3d.bench.scenes.wrong_models import wrong_model
from explore3d.bench.wrong_models import _astray, wrong_model_run
from mapping import Surface
from mapping.base import Base
from mapping.base.pose import Pose

# A plate may slide and turn in itself; it was felt to 1 um, and 1 urad
KNOWN = np.array([1e-6, 1e-6, 1.0, 1.0, 1.0, 1e-6]) ** 2


def _placed(body: BenchScene, shift: list[float]) -> Base:
    """A plate whose pose says that it stands as given, but that it may slide; it is off by a shift, m."""
    pose = Pose(np.eye(3), np.zeros(3), body.base.vertices.mean(axis=0), np.diag(KNOWN), observable=3)
    return Base(Surface(body.base.vertices + np.array(shift), body.base.faces), pose=pose.record())


@pytest.fixture
def body() -> BenchScene:
    return wrong_model("plate", "nothing", 1)


def test_a_plate_that_slid_in_itself_stands_where_it_is_known_to(body: BenchScene) -> None:
    base = _placed(body, [1e-3, -2e-3, 0.0])
    pose = Pose.of(base)
    assert pose is not None
    assert _astray(base, pose, body)[0] < 1e-9


def test_a_plate_that_stands_too_high_is_off_by_that(body: BenchScene) -> None:
    base = _placed(body, [1e-3, 0.0, 0.3e-3])
    pose = Pose.of(base)
    assert pose is not None
    off, doubt = _astray(base, pose, body)
    assert off == pytest.approx(0.3e-3, rel=1e-6)
    # 1 um up, and turns of 1 urad about both axes at 71 mm, the corner's distance from the middle
    assert doubt == pytest.approx(1e-6, rel=0.01)


def test_an_object_is_placed_off_its_model_as_far_as_is_said() -> None:
    body = wrong_model("sphere", "placed off", 3)
    assert body.misplaced
    moved = body.object.vertices[: len(body.base.vertices)]
    still = body.base.vertices
    assert np.linalg.norm(moved.mean(axis=0) - still.mean(axis=0)) == pytest.approx(3e-3, rel=1e-6)
    rotation = np.linalg.lstsq(still - still.mean(axis=0), moved - moved.mean(axis=0), rcond=None)[0].T
    assert np.degrees(Pose.angle(rotation)) == pytest.approx(2.0, rel=1e-6)


@pytest.mark.slow
def test_a_wire_whose_few_crossings_are_not_quite_on_one_course_is_not_parted() -> None:
    found = wrong_model_run(wrong_model("cylinder", "dent", 2), "dent", 2)
    assert found["named"] and (found["found"], found["invented"]) == (1, 0)
