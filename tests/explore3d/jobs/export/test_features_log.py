"""The log with the features drawn in it: the same samples, and a scene as viewers of MCAP read it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sample_logs import write_log
from two_features import two_features

from explore3d import UserError
from explore3d.jobs.export.features_log import FEATURES_TOPIC, SCENE_UPDATE_SCHEMA, scene_update, write_features_log
from explore3d.log import read_log


def scene_of(path: Path) -> tuple[dict[str, Any], int]:
    """The only scene in an MCAP file, and its time."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        ((schema, _, message),) = make_reader(file).iter_messages(topics=[FEATURES_TOPIC])
    assert schema is not None and schema.name == "foxglove.SceneUpdate"
    return json.loads(message.data), message.log_time


def test_the_log_and_the_features_stand_in_one_file_that_reads_as_the_log_does(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=3, count=700)
    path = write_features_log(two_features(), log, tmp_path / "features.mcap")
    one, other = read_log(log), read_log(path)
    assert np.array_equal(one.trace.centers, other.trace.centers) and np.array_equal(one.trace.t, other.trace.t)
    assert other.complete and not other.recovered and other.events == one.events
    scene, _ = scene_of(path)
    assert [each["id"] for each in scene["entities"]] == ["base", "ridge-1", "bump-1"]
    assert {each["frame_id"] for each in scene["entities"]} == {"object"}


def test_features_are_shown_from_the_first_message_on(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    log = write_log(tmp_path / "log.mcap", moves=2, count=10)
    path = write_features_log(two_features(), log, tmp_path / "features.mcap")
    with path.open("rb") as file:
        first = min(message.log_time for _, _, message in make_reader(file).iter_messages())
    assert scene_of(path)[1] == first


def test_a_killed_log_gives_what_is_intact(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=3, count=3000)
    log.write_bytes(log.read_bytes()[: log.stat().st_size * 2 // 3])
    path = write_features_log(two_features(), log, tmp_path / "features.mcap")
    known = read_log(log).trace.centers
    assert 0 < len(known) < 9000 and np.array_equal(read_log(path).trace.centers, known)


def test_a_model_without_its_log_is_a_scene_alone(tmp_path: Path) -> None:
    scene, time_ns = scene_of(write_features_log(two_features(), None, tmp_path / "features.mcap"))
    assert len(scene["entities"]) == 3 and time_ns == 0


def test_a_ridge_has_its_body_its_axis_and_its_name() -> None:
    base, ridge, bump = scene_update(two_features(), 1_500_000_000)["entities"]
    assert ridge["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    (line,), (label,), (body,) = ridge["lines"], ridge["texts"], ridge["triangles"]
    assert line["points"][2] == {"x": 0.02, "y": 0.01, "z": 0.0}
    assert label["text"].startswith("ridge-1: 1.000 mm (")
    half_way = 0.5 * (0.01 - 0.01 * np.sqrt(2.0))  # before the second point, seen from the longer leg
    assert label["pose"]["position"]["x"] == pytest.approx(0.01 - half_way / np.sqrt(2.0))
    assert max(body["indices"]) < len(body["points"]) and len(body["indices"]) % 3 == 0
    assert {each["key"] for each in ridge["metadata"]} == {"kind", "height", "width", "length"}
    assert not bump["lines"] and len(base["triangles"][0]["indices"]) == 6


def test_the_schema_names_every_field_that_is_written() -> None:
    def described(schema: dict[str, Any], value: Any) -> None:
        if isinstance(value, dict):
            assert set(value) == set(schema["properties"]), schema["title"]
            for name, part in value.items():
                described(schema["properties"][name], part)
        elif isinstance(value, list):
            for part in value:
                described(schema["items"], part)

    described(SCENE_UPDATE_SCHEMA, scene_update(two_features(), 0))


def test_a_log_whose_channels_are_destroyed_is_refused_and_nothing_is_left(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.mcap", moves=2, count=10)
    content = bytearray(log.read_bytes())
    at = content.index(b"zstd")  # the first chunk, which names the channels
    content[at + 20 : at + 40] = bytes(20)
    log.write_bytes(content)
    with pytest.raises(UserError, match="names its channels is destroyed"):
        write_features_log(two_features(), log, tmp_path / "features.mcap")
    assert [each.name for each in tmp_path.iterdir()] == ["log.mcap"]
