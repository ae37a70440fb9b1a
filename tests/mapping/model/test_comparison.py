"""Two scans compared: the frames are found, changes are told from doubt, and probabilities mean what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping import Feature, Interval, Support, Surface
from mapping.base import Base
from mapping.model import ObjectModel, compare_models, register

HALF = 0.05
CORNERS = HALF * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))
PLACE_SD, HEIGHT_SD = 20e-6, 5e-6


def bump(place: np.ndarray, height: float, snr: float = 50.0) -> Feature:
    return Feature(
        "bump",
        np.array([[*place, 0.0]]),
        np.array([[0.0, 0.0, 1.0]]),
        Interval.normal(height, HEIGHT_SD),
        Interval.normal(1e-3, 1e-5),
        Interval(0.0, 0.0, 0.0),
        Support(snr, 3, log_odds=100.0),
        True,
        PLACE_SD,
    )


def model(places: np.ndarray, heights: np.ndarray, **about: object) -> ObjectModel:
    bumps = [bump(place, height) for place, height in zip(places, heights, strict=True)]
    return ObjectModel.attach(PLATE, bumps, provenance={"detection_limit": 1e-5}, **about)


def grid(count: int, rng: np.random.Generator) -> np.ndarray:
    side = int(np.ceil(np.sqrt(count)))
    x, y = np.meshgrid(*[np.linspace(-0.8, 0.8, side) * HALF] * 2)
    return np.column_stack([x.ravel(), y.ravel()])[:count] + rng.uniform(-1e-3, 1e-3, (count, 2))


def scans(seed: int, underrated: float = 1.0) -> tuple[ObjectModel, ObjectModel, dict[str, set[int]]]:
    """Two scans of 100 bumps of which ten each grew, moved and went; errors are `underrated` times what is said."""
    rng = np.random.default_rng(seed)
    places, heights = grid(100, rng), rng.uniform(0.1e-3, 0.5e-3, 100)
    grown, moved, gone = rng.permutation(100)[:30].reshape(3, 10)
    later, tall = places.copy(), heights.copy()
    tall[grown] += rng.normal(0.0, 20 * HEIGHT_SD, 10)
    later[moved] += rng.normal(0.0, 20 * PLACE_SD, (10, 2))
    keep = np.setdiff1d(np.arange(100), gone)

    def felt(place: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        off = underrated * PLACE_SD * rng.standard_normal(place.shape)
        return place + off, height + underrated * HEIGHT_SD * rng.standard_normal(len(height))

    turn, shift = 0.01, np.array([0.8e-3, -0.5e-3])
    back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    seen, tall = felt(later[keep], tall[keep])
    truth = {"moved": set(moved.tolist()), "gone": set(gone.tolist()), "height": set(grown.tolist())}
    return model(*felt(places, heights)), model((seen - shift) @ back.T, tall), truth


def judged(seed: int, underrated: float = 1.0) -> list[tuple[float, bool]]:
    """The probability of each change that was weighed, and whether it is true."""
    first, second, truth = scans(seed, underrated)
    number = {feature.id: k for k, feature in enumerate(first.features)}
    told = []
    for change in compare_models(first, second).changes:
        name = "height" if change.kind in ("grown", "shrunk") else change.kind
        told.append((change.probability, number.get(change.first, -1) in truth.get(name, set())))
    return told


@pytest.mark.parametrize("underrated", [1.0, pytest.param(2.0, marks=pytest.mark.slow)])
def test_probabilities_of_changes_mean_what_they_say(underrated: float) -> None:
    told = np.array([each for seed in range(5) for each in judged(seed, underrated)], dtype=np.float64)
    for low, high in ((0.0, 0.1), (0.1, 0.9), (0.9, 1.01)):
        part = told[(told[:, 0] >= low) & (told[:, 0] < high)]
        sd = np.sqrt(np.maximum(part[:, 0].mean() * (1.0 - part[:, 0].mean()), 1e-4) / len(part))
        assert abs(part[:, 0].mean() - part[:, 1].mean()) < 4.0 * sd, (low, high, part.mean(axis=0), len(part))
    listed = told[told[:, 0] > 0.95]
    assert listed[:, 1].mean() > 0.98


def test_a_scan_compared_with_itself_shows_nothing() -> None:
    first, _, _ = scans(3)
    result = compare_models(first, first)
    assert result.pairs == 100 and max(change.probability for change in result.changes) < 0.05
    assert np.abs(result.registration.shift).max() < 1e-9


def test_the_frames_are_found_within_their_standard_deviation() -> None:
    first, second, _ = scans(4)
    motion = register(first.features, second.features, 5e-3)
    turn = np.arctan2(motion.rotation[1, 0], motion.rotation[0, 0])
    assert abs(turn - 0.01) < 4.0 * np.sqrt(motion.covariance[5, 5]) and motion.pairs > 80
    corner = np.array([[0.04, 0.04, 0.0]])
    true = corner[:, :2] @ np.array([[np.cos(0.01), np.sin(0.01)], [-np.sin(0.01), np.cos(0.01)]]) + [0.8e-3, -0.5e-3]
    assert np.abs(motion.moved(corner)[:, :2] - true).max() < 4.0 * PLACE_SD / np.sqrt(40.0)


def test_without_features_the_frames_are_taken_as_they_are() -> None:
    empty, one = model(np.zeros((0, 2)), np.zeros(0)), model(np.zeros((1, 2)), np.array([1e-4]))
    result = compare_models(empty, one)
    assert result.registration.pairs == 0 and [change.kind for change in result.changes] == ["new"]
    assert result.changes[0].probability > 0.9
    assert compare_models(empty, empty).changes == ()


def test_what_the_second_scan_did_not_look_at_is_not_gone() -> None:
    places, heights = grid(9, np.random.default_rng(0)), np.full(9, 2e-4)
    first = model(places, heights)
    left_half = replace(model(places[:-1], heights[:-1]), inspected=np.array([np.inf, np.inf]))
    result = compare_models(first, left_half)
    assert result.unseen == ("bump-9",)
    assert [change.probability for change in result.changes if change.kind == "gone"] == [0.0]


def test_a_faint_feature_that_is_missed_may_still_be_there() -> None:
    places, heights = grid(9, np.random.default_rng(0)), np.full(9, 2e-4)
    first, second = model(places, heights), model(places[:-1], heights[:-1])
    faint = replace(first.features[8], evidence=Support(4.6, 1, log_odds=10.0))
    first = replace(first, features=(*first.features[:8], faint))
    (gone,) = [change for change in compare_models(first, second).changes if change.kind == "gone"]
    assert gone.probability < 0.6
