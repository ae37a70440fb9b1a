"""LaMotte's task, asked of the detector."""

from __future__ import annotations

from explore3d.bench import touch
from explore3d.bench.touch import bench_touch, touch_lines


def test_the_detector_feels_what_people_feel_and_guesses_where_nothing_is(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(touch, "HUMAN_HEIGHTS", {"dot 231 um": touch.HUMAN_HEIGHTS["dot 231 um"]})
    monkeypatch.setattr(touch, "HEAD_NOISE", {"white": touch.HEAD_NOISE["white"]})
    monkeypatch.setattr(touch, "HEIGHT_SHARES", (1e-3, 1.0))
    nothing, human = list(bench_touch(12, seed=5))
    assert human.right > 0.9 and nothing.right < 0.9
    assert touch_lines([nothing, human])[-1].startswith("| dot 231 um | 2.94 um | white | ")
