"""The view in the browser: what its server shows of a session, finished or growing; a slow test clicks in a browser."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from browser import chromium
from reported_wire import AXIS, BASE, TIP, ridge, sweeps
from watched_in_browser import clicked_features, mug_with_features

from explore3d.errors import UserError
from explore3d.log.own.reader import digest
from explore3d.log.own.record import base_event
from explore3d.log.own.tail import Piece
from explore3d.log.own.writer import LogWriter
from explore3d.pictures.cross_section import cross_section
from explore3d.report.watch.feature_panel import feature_panel
from explore3d.report.watch.touched import touched
from explore3d.report.watch.view import ViewBeside, Watch, need_viewer
from hw.move import Move
from mapping.model.object_model import ObjectModel
from mapping.trace import Trace

pytest.importorskip("viser")
DOWN = np.array([0.0, 0.0, -1.0])


def record(path: Path, parts: int = 11) -> LogWriter:
    """The wire's log, its first sweeps written, still open."""
    log = LogWriter(path, tip_radius=TIP, scene_text='title = "A *wire*"\n', metadata={"job": "run"})
    log.event("base", base_event(BASE))
    for _, part in list(sweeps().sweeps())[:parts]:
        add(log, part)
    return log


def add(log: LogWriter, part: Trace) -> None:
    log.write(Move(part.centers[[0, -1]], np.tile(DOWN, (2, 1)), speed=0.03, force=1.0), part)


def save_model(folder: Path) -> None:
    about = {"log_sha256": digest(folder / "log.mcap")}
    ObjectModel.attach(BASE, (ridge(),), provenance=about).save(folder)


def shown(view: Watch) -> int:
    """Drawn samples that browsers have."""
    return sum(len(node.points) for node in view.stage._nodes.values() if node.visible)


@pytest.fixture
def session(tmp_path: Path) -> Path:
    record(tmp_path / "log.mcap").close()
    save_model(tmp_path)
    return tmp_path


@pytest.fixture
def view(session: Path) -> Iterator[Watch]:
    view = Watch(session, port=0)
    view.look()
    yield view
    view.close()


def test_a_finished_session_shows_every_sweep_and_feature(view: Watch) -> None:
    assert view.stage.count == len(sweeps())
    assert set(view.stage.features) == {"ridge-1"}
    assert shown(view) == view.stage.drawn > 0
    assert "5,500 samples" in view._state.content and "1 feature" in view._state.content
    assert "A \\*wire\\*" in view._state.content  # a title is text, not Markdown
    assert not view.look()  # nothing is new


def test_scrubbing_shows_what_had_been_felt_by_then(view: Watch) -> None:
    for t, expected in ((-1.0, 0), (0.0, 1), (2749.5, 2750), (1e9, 5500)):
        view.scrub(t)
        drawn = int((view.stage._drawn[: view.stage.drawn] < expected).sum())
        assert view.stage.count_at(t) == expected
        assert shown(view) == drawn
    view.scrub(499.0)  # the end of the first sweep: the tip stands there
    tip = np.array(view.stage._tip.position) * view.stage._size / 2.0 + view.stage._origin
    np.testing.assert_allclose(tip, sweeps().centers[499], atol=1e-6)


def test_a_clicked_feature_tells_sizes_evidence_profile_and_posterior(view: Watch) -> None:
    view.stage.picked("ridge-1")
    assert view._choice.value == "ridge-1"
    assert view._words.content.startswith("### ridge-1\n") and "0.650 mm" in view._words.content
    assert "signal to noise 99 over 7 crossings" in view._words.content
    assert len(view._pictures) == 1 and "<svg" in view._pictures[0].content
    view.choose(None)
    assert view._choice.value == "none" and not view._pictures


def test_the_posterior_is_drawn_where_there_is_one() -> None:
    from mapping.posterior import Posterior

    draws = np.random.default_rng(1).normal([6.5e-4, 6.5e-4], 1e-5, (200, 2))
    posterior = Posterior(("height", "width"), ("m", "m"), draws, 5.0, 0.3, "converged", "200 draws")
    words, pictures = feature_panel(replace(ridge(), id="ridge-1", posterior=posterior), BASE, None)
    assert "posterior of 200 draws, converged" in words and len(pictures) == 1


def test_a_view_grows_with_the_log_of_a_run_and_then_shows_its_model(tmp_path: Path) -> None:
    view = Watch(tmp_path / "out", live=True, port=0)  # before the run has made its folder
    try:
        assert not view.look()
        (tmp_path / "out").mkdir()
        log = record(tmp_path / "out" / "log.mcap", 2)
        assert view.look() and view.stage.count == 1000 and "growing" in view._state.content
        parts = [part for _, part in sweeps().sweeps()]
        log.felt(parts[2].select(slice(0, 100)))
        assert view.look() and view.stage.count == 1100
        for part in parts[2:]:
            add(log, part)
        assert view.look() and view.stage.count == 5500
        np.testing.assert_array_equal(view.stage.t[:5500], sweeps().t)
        assert shown(view) == view.stage.drawn
        log.close()
        save_model(tmp_path / "out")
        assert view.look() and set(view.stage.features) == {"ridge-1"}
    finally:
        view.close()


def test_a_live_view_does_not_take_an_older_session_for_the_run(session: Path) -> None:
    view = Watch(session, live=True, port=0)
    try:
        assert not view.look() and view.stage.count == 0
        (session / "unfinished-1").mkdir()
        record(session / "unfinished-1" / "log.mcap", 1)
        assert view.look() and view.stage.count == 500 and not view.stage.features
    finally:
        view.close()


def test_a_folder_without_a_session_is_refused_and_so_is_a_missing_viewer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UserError, match="holds neither"):
        Watch(tmp_path, port=0)
    monkeypatch.setattr("explore3d.report.watch.view.find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"explore3d\[watch\]"):
        need_viewer()


def test_a_file_that_is_no_log_is_refused_and_the_rest_of_a_log_is_not(session: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text("<!doctype html><title>report</title>" + "x" * 5000)
    with pytest.raises(UserError, match=r"report\.html: is no log"):
        Watch(page, port=0)
    log = tmp_path / "log.mcap"
    log.write_bytes(b"\0" * 8 + log.read_bytes()[8:])
    view = Watch(log, port=0)
    try:
        assert view.look() and view.stage.count == 5500
    finally:
        view.close()


def test_a_damaged_model_is_said_until_it_is_mended(session: Path) -> None:
    whole = (session / "model.json").read_text("utf-8")
    (session / "model.json").write_text(whole[: len(whole) // 2], "utf-8")
    view = Watch(session, port=0)
    try:
        assert view.look() and view.stage.count == 5500 and view.model is None
        assert "model is not shown" in view._state.content and "not a readable model" in view._state.content
        assert not view.look()  # said once
        (session / "model.json").write_text(whole, "utf-8")
        assert view.look() and set(view.stage.features) == {"ridge-1"}
        assert "not shown" not in view._state.content
    finally:
        view.close()


def test_a_view_beside_a_run_begins_with_the_finger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[list[str]] = []
    monkeypatch.setattr("explore3d.report.watch.view.subprocess.Popen", lambda command, **_: begun.append(command))
    told: list[tuple[str, float]] = []
    beside = ViewBeside(tmp_path / "out", lambda stage, share: told.append((stage, share)))
    beside("setting up", 1.0)
    assert not begun
    beside("exploration", 0.0)
    assert begun[0][-4:] == ["watch", str(tmp_path / "out"), "--live", "--attached"]
    assert told == [("setting up", 1.0), ("exploration", 0.0)]


def samples_of(centers: np.ndarray, **more: np.ndarray) -> Any:
    names = ["x", "y", "z", *more]
    return np.rec.fromarrays([*centers.T, *more.values()], names=names)


def test_places_of_contact_are_felt_or_follow_the_pressing() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 4000)
    outward = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    waypoints = outward[::20]
    move = SimpleNamespace(data={"path": (1.1 * waypoints).tolist(), "approach": (-waypoints).tolist()})
    every = np.arange(len(outward))
    found = touched(Piece(samples_of(1.1 * outward), move), 0.1, every)
    # 50 samples share one direction, 20 one waypoint: the ball is 0.1 long, turned by half of both at most
    np.testing.assert_allclose(found, outward, atol=0.1 * 0.5 * (50 + 20) * 2.0 * np.pi / 4000)
    some = touched(Piece(samples_of(1.1 * outward), move), 0.1, every[::7])
    np.testing.assert_allclose(some, outward[::7], atol=0.1 * 0.5 * (50 + 20) * 2.0 * np.pi / 4000)
    np.testing.assert_array_equal(touched(Piece(samples_of(outward), None, under_way=True), 0.1, every), outward)
    felt = dict(zip(("nx", "ny", "nz"), outward.T, strict=True))
    np.testing.assert_allclose(touched(Piece(samples_of(1.1 * outward, **felt), None), 0.1, every), outward, atol=1e-12)


def test_without_crossings_the_section_is_of_a_sweep_across_the_line_not_along_it() -> None:
    across = sweeps()
    x = np.arange(-0.02, 0.02, 1e-4)
    along = Trace(
        1e4 + np.arange(len(x)), np.column_stack([x, 0.0 * x, 0.0 * x + TIP + 6.5e-4]), np.full(len(x), 99), TIP
    )
    section = cross_section(ridge(), Trace.concatenate([across, along]), BASE, ())
    assert section is not None and section.sweep == 5 and abs(AXIS[0, 1]) == 0.0
    assert section.height.max() == pytest.approx(6.5e-4, rel=0.01)


@pytest.mark.slow
def test_every_feature_is_picked_by_a_click_in_a_browser_that_asks_nobody_else(tmp_path: Path) -> None:
    if chromium() is None:
        pytest.skip("no Chromium")
    mug_with_features(tmp_path)
    found = clicked_features(tmp_path)
    assert len(found.clicks) == 4
    assert [read for _, read in found.clicks] == [name for name, _ in found.clicks]
    assert found.outside == []
