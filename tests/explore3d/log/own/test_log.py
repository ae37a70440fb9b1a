"""The log: bit-exact, repeatable, and readable by other programs."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import textwrap
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from sample_logs import MOVE, RADIUS, assert_same_samples, trace_of, write_log

from explore3d.errors import UserError
from explore3d.log.load import load_logs
from explore3d.log.own import format as log_format, point_cloud
from explore3d.log.own.reader import iter_log, read_log
from explore3d.log.own.writer import LogWriter, Recorder
from hw.move import Move
from mapping.trace import Trace


def test_every_bit_of_the_samples_comes_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    count = 1234
    bits = rng.integers(0, 2**62, (10, count, 3), dtype=np.int64).view(np.float64)  # any finite pattern of bits
    bits[~np.isfinite(bits)] = 0.0
    bits[0, :4, 0] = [-0.0, 5e-324, np.finfo(float).max, np.nextafter(1.0, 2.0)]
    trace = Trace(
        bits[1, :, 0],
        bits[0],
        rng.integers(-(2**31), 2**31, count),
        RADIUS,
        normals=bits[2],
        contacts=bits[3],
        force=bits[4],
    )
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace)
    back = read_log(tmp_path / "log.mcap").trace
    assert np.array_equal(back.sweep, trace.sweep)
    for name in ("t", "centers", "normals", "contacts", "force"):
        assert getattr(back, name).tobytes() == getattr(trace, name).tobytes(), name


def test_a_closed_log_comes_back_whole_with_scene_events_and_moves(tmp_path: Path) -> None:
    log = read_log(write_log(tmp_path / "log.mcap"))
    assert log.complete and log.recovered == ""
    assert log.scene_text == "seed = 1\n" and log.metadata["seed"] == 1
    assert_same_samples(log.trace, np.arange(12 * 700))
    assert [event.kind for event in log.events] == ["move", "move", "detection"] * 12
    move = log.events[3]
    assert (move.data["first"], move.data["samples"]) == (700, 700)
    assert np.array_equal(move.data["path"], MOVE.path) and np.array_equal(move.data["approach"], MOVE.approach)
    assert log.events[2].data == {"number": 0, "at": [1.0, 2.0]}
    assert log.sha256 == hashlib.sha256((tmp_path / "log.mcap").read_bytes()).hexdigest()


def test_a_recorder_remembers_what_its_log_says(tmp_path: Path) -> None:
    empty = Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=int), RADIUS)
    with Recorder(tmp_path / "log.mcap", tip_radius=RADIUS, scene_text="a = 1\n", metadata={"n": np.arange(2)}) as log:
        log.event("base", {"vertices": np.eye(3)})
        log.write(MOVE, empty)
        for first in (0, 700):
            log.write(MOVE, trace_of(first, 700))
    remembered, read = log.recorded(), read_log(tmp_path / "log.mcap")
    for name in ("t", "centers", "sweep", "normals", "contacts", "force"):
        one, other = getattr(remembered.trace, name), getattr(read.trace, name)
        assert (one is None and other is None) or one.tobytes() == other.tobytes(), name
    for name in ("scene_text", "events", "metadata", "complete", "recovered", "sha256", "sources"):
        assert getattr(remembered, name) == getattr(read, name), name
    assert remembered.trace.resolution == read.trace.resolution


def test_what_was_felt_of_a_move_that_never_ended_is_recovered(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path, tip_radius=RADIUS, resolution=4e-6) as log:
        for first in (0, 10):
            log.felt(trace_of(first, 10))
        log.write(MOVE, trace_of(0, 20))
        assert len(read_log(path).trace) == 20  # what a whole move felt is not there twice
        log.felt(trace_of(20, 10, 1))
        log.event("note", {})
        log.felt(trace_of(30, 5, 1))
        broken = read_log(path)
    assert_same_samples(broken.trace, np.arange(35))
    assert "15 of them of a move that was broken off" in broken.recovered
    assert broken.trace.resolution == 4e-6
    assert sum(map(len, iter_log(path, samples=10))) == 35


def test_a_sweep_whose_times_run_backwards_is_refused_in_one_sentence(tmp_path: Path) -> None:
    trace = Trace([2.0, 1.0, 0.0], np.zeros((3, 3)), [4, 4, 4], RADIUS)
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace)
    with pytest.raises(UserError, match=r"log\.mcap: field t: .* 2 of 3 samples lie before their predecessor"):
        read_log(tmp_path / "log.mcap")


def test_the_same_samples_give_the_same_bytes(tmp_path: Path) -> None:
    one = write_log(tmp_path / "one.mcap").read_bytes()
    time.sleep(0.6)  # longer than the period of syncing
    assert write_log(tmp_path / "two.mcap").read_bytes() == one


def test_optional_fields_are_kept_only_if_all_samples_have_them(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace_of(0, 5, normals=np.ones((5, 3)), force=np.full((5, 3), 2.0)))
        log.write(MOVE, trace_of(5, 5, force=np.full((5, 3), 3.0)))
    trace = read_log(tmp_path / "log.mcap").trace
    assert trace.normals is None and trace.contacts is None
    assert trace.force is not None and trace.force[:, 0].tolist() == [2.0] * 5 + [3.0] * 5


def test_batches_of_iter_log_are_the_whole_log(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap")
    traces = list(iter_log(path, samples=1000))
    assert all(1000 <= len(trace) < 1500 for trace in traces[:-1]) and len(traces) > 5
    assert_same_samples(Trace.concatenate(traces), np.arange(12 * 700))


def test_the_wall_clock_is_in_the_log_only_if_given(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    started = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS, started=started) as log:
        log.write(MOVE, trace_of(5000, 10))
    assert read_log(tmp_path / "log.mcap").metadata["started"] == "2026-01-02T03:04:05+00:00"
    with (tmp_path / "log.mcap").open("rb") as file:
        times = [message.log_time for _, channel, message in make_reader(file).iter_messages(["/trace"])]
    assert times == [int(started.timestamp() * 1e9) + 1_000_000_000]


def test_other_programs_can_read_it_by_its_own_schemas(tmp_path: Path) -> None:
    descriptor = pytest.importorskip("google.protobuf.descriptor_pb2", reason="protobuf is not installed")
    from google.protobuf import descriptor_pool, message_factory
    from mcap.reader import make_reader

    pool = descriptor_pool.DescriptorPool()
    with write_log(tmp_path / "log.mcap", moves=2).open("rb") as file:
        reader = make_reader(file)
        schema, _, message = next(reader.iter_messages(["/trace"]))
        assert {a.name: a.data for a in reader.iter_attachments()} == {"scene.toml": b"seed = 1\n"}
        assert next(iter(reader.iter_metadata())).metadata == {"seed": "1", "tip_radius": "0.01"}
    for proto in descriptor.FileDescriptorSet.FromString(schema.data).file:
        pool.Add(proto)
    cloud = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))()
    cloud.ParseFromString(message.data)
    assert cloud.frame_id == "object" and cloud.pose.orientation.w == 1.0
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "t", "sweep"]
    assert [field.type for field in cloud.fields] == [8, 8, 8, 8, 6]
    assert len(cloud.data) == cloud.point_stride * log_format.SAMPLES_PER_MESSAGE
    points = np.frombuffer(cloud.data, log_format.sample_dtype())
    assert np.array_equal(points["z"], np.arange(500) / 3.0)


def test_events_follow_their_own_json_schemas(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    from mcap.reader import make_reader

    seen = set()
    with write_log(tmp_path / "log.mcap", moves=2).open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                seen.add(channel.topic)
                jsonschema.validate(json.loads(message.data), json.loads(schema.data))
    assert seen == {"/start", "/move", "/path", "/event", "/end"}


def test_arrows_of_the_path_point_where_the_finger_presses(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    directions = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, -1], [0.6, 0.0, 0.8], [-0.48, 0.6, 0.64]], dtype=float)
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(Move(np.zeros((5, 3)), directions), trace_of(0, 0))
    with (tmp_path / "log.mcap").open("rb") as file:
        poses = json.loads(next(make_reader(file).iter_messages(["/path"]))[2].data)["poses"]
    for pose, direction in zip(poses, directions, strict=True):
        x, y, z, w = (pose["orientation"][axis] for axis in "xyzw")
        turned = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
        assert np.allclose(turned, direction, atol=1e-12)


def test_bytes_that_are_no_point_cloud_are_refused() -> None:
    good = point_cloud.encode(
        np.zeros(3, log_format.sample_dtype()), point_cloud.encode_prefix(log_format.sample_dtype(), "object"), 12_345
    )
    assert len(point_cloud.decode(good)) == 3
    for bad in (b"", b"\xff" * 30, good[:-1], good[: len(good) // 2], good + b"\x0f"):
        with pytest.raises(point_cloud.PointCloudError):
            point_cloud.decode(bad)


def test_several_logs_merge_with_sweeps_and_moves_renumbered(tmp_path: Path) -> None:
    paths = [write_log(tmp_path / f"{name}.mcap", moves=2, count=10) for name in "ab"]
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "log.mcap").write_bytes(paths[0].read_bytes())
    log = load_logs([*paths, tmp_path / "session"])
    assert len(log.trace) == 60 and np.unique(log.trace.sweep).tolist() == [0, 1, 2, 3, 4, 5]
    firsts = [event.data["first"] for event in log.events if event.kind == "move" and event.data["samples"]]
    assert firsts == [0, 10, 20, 30, 40, 50]
    assert log.complete and log.scene_text == "seed = 1\n" and len(log.sources) == 3


# --- speed and memory -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_million_samples_a_second(tmp_path: Path) -> None:
    count = 1_000_000
    trace = trace_of(0, count)
    start = time.process_time()
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        for first in range(0, count, 5000):
            log.write(MOVE, trace.select(slice(first, first + 5000)))
    writing = time.process_time() - start
    start = time.process_time()
    assert len(read_log(tmp_path / "log.mcap").trace) == count
    reading = time.process_time() - start
    assert count / writing > 1e6 and count / reading > 1e6, (writing, reading)


@pytest.mark.slow
def test_streaming_needs_no_more_memory_for_a_longer_log(tmp_path: Path) -> None:
    def peak(samples: int) -> int:
        script = f"""
            import sys, resource
            sys.path.insert(0, {str(Path(__file__).parents[3] / "support" / "logs")!r})
            from sample_logs import MOVE, RADIUS, trace_of
            from explore3d.log import LogWriter
            from explore3d.log import iter_log
            with LogWriter({str(tmp_path / str(samples))!r}, tip_radius=RADIUS) as log:
                for first in range(0, {samples}, 20000):
                    log.write(MOVE, trace_of(first, 20000))
            assert sum(len(trace) for trace in iter_log({str(tmp_path / str(samples))!r})) == {samples}
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        """
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])}
        run = [sys.executable, "-c", textwrap.dedent(script)]
        return int(subprocess.run(run, env=environment, capture_output=True, check=True).stdout)

    assert peak(4_000_000) < peak(400_000) + 20_000  # kB
