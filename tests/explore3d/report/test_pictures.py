"""Cameras project what their rays see; pictures show what stands in front."""

import numpy as np
import pytest

from explore3d.pictures.camera import Camera
from explore3d.pictures.sweep_paths import sweep_paths
from explore3d.scene.units import count_text, seconds_text
from mapping import length_text
from mapping.base.base import Base
from mapping.feature import Interval
from mapping.surface import Surface
from mapping.trace import Trace

SQUARE = Surface([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("direction", [[0.0, 0, 1], [1, -1, 0.4], [-0.3, 0.2, -2]])
def test_rays_and_projection_agree(direction: list[float]) -> None:
    camera = Camera.facing(SQUARE.vertices, np.array(direction), 64, 48)
    rows, columns = np.divmod(np.arange(camera.width * camera.height), camera.width)
    points = camera.eye + 3.7 * camera.rays(rows, columns)
    place, depth = camera.project(points)
    np.testing.assert_allclose(place, np.column_stack([columns, rows]), atol=1e-9)
    np.testing.assert_allclose(depth, 3.7)


def test_everything_asked_for_is_in_view_and_fills_it() -> None:
    points = np.random.default_rng(1).normal(size=(200, 3)) * [3.0, 1.0, 0.2]
    camera = Camera.facing(points, np.array([0.2, -1.0, 0.8]), 640, 480)
    place, _ = camera.project(points)
    assert (place > -1).all() and (place < [camera.width, camera.height]).all()
    assert np.ptp(place[:, 0]) > 0.8 * camera.width or np.ptp(place[:, 1]) > 0.8 * camera.height


def test_a_picture_shows_the_nearer_body_and_hides_points_behind_it() -> None:
    from explore3d.pictures.render import Body, render

    red, blue = np.array([0.9, 0.0, 0.0]), np.array([0.0, 0.0, 0.9])
    small = Surface(0.3 * SQUARE.vertices + [0, 0, 0.5], SQUARE.faces)
    camera = Camera(np.array([0.0, 0, 6]), np.zeros(3), np.array([0.0, 1, 0]), 60, 60)
    picture = render([Body(SQUARE, blue), Body(small, red)], camera)
    assert picture.pixels[30, 30].argmax() == 0 and picture.pixels[30, 14].argmax() == 2
    assert (picture.pixels[0, 0] == 1.0).all()
    assert picture.depth[30, 30] == pytest.approx(5.5) and np.isinf(picture.depth[0, 0])
    green = np.array([0.0, 1.0, 0.0])
    picture.splat(np.array([[0.0, 0, 0.2], [0.0, 0.9, 0.1]]), green, 1.0, 0.01)
    assert picture.pixels[30, 30].argmax() == 0
    column, row = np.rint(camera.project(np.array([[0.0, 0.9, 0.1]]))[0][0]).astype(int)
    np.testing.assert_array_equal(picture.pixels[row, column], green)


def test_a_picture_far_from_the_origin_is_the_same_picture() -> None:
    from explore3d.pictures.render import Body, render

    def drawn(shift: float) -> np.ndarray:
        body = Surface(SQUARE.vertices + shift, SQUARE.faces)
        return render([Body(body, np.array([0.5, 0.6, 0.7]))], Camera.facing(body.vertices, np.ones(3), 80, 60)).pixels

    np.testing.assert_allclose(drawn(2.0**20), drawn(0.0), atol=1e-6)


def test_a_drawn_sweep_is_free_of_the_jitter_of_its_samples() -> None:
    rng = np.random.default_rng(2)
    x = np.linspace(-0.9, 0.9, 20_000)
    centers = np.column_stack([x, 0 * x, 0.1 + 0 * x]) + rng.normal(0, 2e-3, (len(x), 3))
    (path,) = sweep_paths(Trace(x, centers, np.zeros(len(x), dtype=int), 0.1), Base(SQUARE))
    assert 200 < len(path.points) < 800
    assert path.points[:, 1].std() < 6e-4 and not path.noticed.any()


def test_lengths_are_told_in_the_unit_that_fits() -> None:
    assert [length_text(v) for v in (6.5e-4, 4.34e-8, 2.31, 0.0, float("nan"))] == [
        "0.65 mm",
        "43.4 nm",
        "2.31 m",
        "0 mm",
        "–",
    ]


def test_an_interval_has_no_more_digits_than_are_known() -> None:
    assert Interval(6.513e-4, 6.463e-4, 6.561e-4).text() == ("0.6513 mm", "0.6463 to 0.6561")
    assert Interval(6.5e-4, 3.1e-4, 8.2e-4).text() == ("0.65 mm", "0.31 to 0.82")
    assert Interval(0.05, 0.0498, np.inf, censored=True).text() == ("at least 49.8 mm", "")
    # a groove in which the ball hangs between the rims, 0.42 to 0.43 mm below the base: its bottom lies there or deeper
    assert Interval(-4.25e-4, -4.31e-4, -4.23e-4, censored=True).text() == ("-0.423 mm or deeper", "")
    depth = Interval(-4.25e-4, -4.31e-4, -4.23e-4, censored=True, bounded=True)
    assert depth.text() == ("between -0.43 and -0.42 mm", "")


def test_a_bound_that_rounds_to_zero_has_no_sign() -> None:
    assert Interval(5e-4, -1e-6, 1e-3).text() == ("0.50 mm", "0.00 to 1.00")


def test_durations_and_counts_read_as_speech() -> None:
    assert [seconds_text(v) for v in (0.012, 3.456, 42.0, 125.0, 7300.0, 1e6, 3e8)] == [
        "12 ms",
        "3.46 s",
        "42 s",
        "2 min 05 s",
        "2 h 01 min",
        "12 days",
        "10 years",
    ]
    assert [count_text(n, "ridge") for n in (0, 1, 2)] == ["no ridges", "1 ridge", "2 ridges"]
