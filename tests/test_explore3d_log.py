"""The log: bit-exact, repeatable, and readable whatever happened to the program or the file."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from explore3d import log_format, point_cloud
from explore3d.errors import UserError
from explore3d.load_logs import load_logs
from explore3d.log import LogWriter
from explore3d.log_chunks import Damage, intact_chunks
from explore3d.log_reader import iter_log, read_log
from explore3d.recording import Log
from hw.moves import Move
from mapping.trace import Trace

RADIUS = 0.01
MOVE = Move([[0.0, 0.1, 0.2], [1.0 / 3.0, 0.0, 0.0]], [0.3, 0.1, -1.0], speed=0.03, force=1.0)


def trace_of(first: int, count: int, sweep: int = 0, **optional: np.ndarray) -> Trace:
    """Samples first, first + 1, ...: every value follows from the sample's number alone."""
    number = np.arange(first, first + count, dtype=np.float64)
    centers = np.column_stack([np.sin(number), np.cos(number) * 1e-7, number / 3.0])
    return Trace(number / 5000.0, centers, np.full(count, sweep), RADIUS, **optional)


def write_log(path: Path, moves: int = 12, count: int = 700) -> Path:
    """A log of several chunks: some moves give no samples, and there are events between them."""
    with LogWriter(path, tip_radius=RADIUS, scene_text="seed = 1\n", metadata={"seed": 1}) as log:
        for number in range(moves):
            log.write(MOVE, trace_of(number * count, count, number))
            log.write(Move([[0, 0, 1]], [0, 0, -1], purpose="travel"), trace_of(0, 0))
            log.event("detection", {"number": number, "at": np.array([1.0, 2.0])})
    return path


def assert_same_samples(trace: Trace, numbers: np.ndarray) -> None:
    truth = trace_of(0, int(numbers.max()) + 1).select(numbers)
    assert np.array_equal(trace.t, truth.t)
    assert np.array_equal(trace.centers, truth.centers)


def numbers_of(trace: Trace) -> np.ndarray:
    return np.rint(trace.t * 5000.0).astype(int)


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


# --- what happens to programs ---------------------------------------------------------------------------

WRITER = textwrap.dedent(
    """
    import sys
    sys.path.insert(0, {tests!r})
    from test_explore3d_log import MOVE, RADIUS, trace_of
    from explore3d.log import LogWriter
    counts = [1, 3, 40, 500, 501, 4000, 60000]
    log = LogWriter({path!r}, tip_radius=RADIUS, scene_text="seed = 1", metadata=dict(seed=1))
    first = 0
    print(0, flush=True)
    for number in range(10**6):
        count = counts[number % len(counts)]
        log.write(MOVE, trace_of(first, count, number))
        first += count
        print(first, flush=True)
    """
)


def kill_writer(path: Path, delay: float) -> int:
    """Start a writer, kill it `delay` seconds after its log exists; the samples that it had acknowledged."""
    script = WRITER.format(tests=str(Path(__file__).parent), path=str(path))
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1]), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment)
    assert process.stdout is not None
    assert process.stdout.readline() == b"0\n"
    time.sleep(delay)
    process.send_signal(signal.SIGKILL)
    lines = process.stdout.read().split(b"\n")[:-1]
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    return int(lines[-1]) if lines else 0


def check_killed(path: Path, delay: float) -> None:
    acknowledged = kill_writer(path, delay)
    log = read_log(path)
    assert len(log.trace) >= acknowledged > 0
    assert_same_samples(log.trace, np.arange(len(log.trace)))
    assert not log.complete
    assert f"recovered {len(log.trace)} samples" in log.recovered and "never closed" in log.recovered
    assert log.scene_text == "seed = 1" and log.metadata["seed"] == 1 and log.trace.tip_radius == RADIUS


@pytest.mark.parametrize("seed", [1, 2])
def test_a_killed_writer_loses_nothing_it_acknowledged(tmp_path: Path, seed: int) -> None:
    check_killed(tmp_path / "log.mcap", np.random.default_rng(seed).uniform(0.05, 0.4))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_ten_killed_writers_lose_nothing_they_acknowledged(tmp_path: Path, seed: int) -> None:
    check_killed(tmp_path / "log.mcap", np.random.default_rng(100 + seed).uniform(0.05, 2.0))


def test_a_log_without_an_end_says_so_even_if_nothing_is_lost(tmp_path: Path) -> None:
    log = LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS)
    log.write(MOVE, trace_of(0, 10))
    back = read_log(tmp_path / "log.mcap")  # while it is still being written
    assert len(back.trace) == 10 and not back.complete and "after a whole chunk" in back.recovered
    log.close()
    assert read_log(tmp_path / "log.mcap").complete


def test_an_exception_closes_the_log_and_is_named_in_it(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace_of(0, 10))
        raise RuntimeError("finger lost")
    assert read_log(tmp_path / "log.mcap").complete
    assert b"finger lost" in b"".join(
        record.data for records in chunks(tmp_path / "log.mcap") for record in records if hasattr(record, "sequence")
    )


# --- what happens to files ------------------------------------------------------------------------------


def chunks(path: Path) -> list[list]:
    with path.open("rb") as file:
        return list(intact_chunks(file, Damage()))


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """(end of the chunk in the file, samples up to there) of each chunk, by the library's own reader."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    ends, samples = [], 0
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                for inner in breakup_chunk(record):
                    if hasattr(inner, "sequence") and inner.channel_id == 5:
                        samples += len(point_cloud.decode(inner.data))
                ends.append((file.tell(), samples))
    return ends


def read_or_refuse(path: Path) -> Log | None:
    try:
        return read_log(path)
    except UserError as error:
        assert str(path) in str(error) and "\n" not in str(error)
        return None


def test_a_log_cut_anywhere_keeps_every_whole_chunk(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=6, count=300)
    whole, ends = path.read_bytes(), chunk_ends(path)
    assert ends[-1][1] == 1800 and len(ends) > 12
    edges = [end + shift for end, _ in ends for shift in (-1, 0, 1)]
    cuts = [*edges, *range(12), *np.random.default_rng(2).integers(0, len(whole), 150).tolist()]
    for cut in cuts:
        path.write_bytes(whole[:cut])
        expected = max([samples for end, samples in ends if end <= cut], default=0)
        log = read_or_refuse(path)
        if expected == 0:
            assert log is None
            continue
        assert log is not None and len(log.trace) == expected
        assert_same_samples(log.trace, np.arange(expected))
        assert log.scene_text == "seed = 1\n"
        # beyond the last chunk lies only the index, which nobody needs
        assert log.complete == (cut >= ends[-1][0])
        assert log.complete or "recovered" in log.recovered


def check_damaged(log: Log | None, total: int, worst: int) -> None:
    """No sample is wrong or out of place, no more than `worst` are lost, and what is lost is said."""
    if log is None:
        return
    numbers = numbers_of(log.trace)
    assert (np.diff(numbers) > 0).all()
    assert_same_samples(log.trace, numbers)
    assert len(numbers) >= total - worst
    if len(numbers) < total:
        assert not log.complete and f"{total - len(numbers)} further samples" in log.recovered


def test_flipped_bits_never_make_a_wrong_sample_and_cost_one_chunk_at_most(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=6, count=300)
    whole = path.read_bytes()
    first_chunk, _ = chunk_ends(path)[0]
    rng = np.random.default_rng(3)
    places = [*range(0, first_chunk, 40), *rng.integers(0, len(whole), 300)]
    for place in places:
        damaged = bytearray(whole)
        damaged[place] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        log = read_or_refuse(path)
        assert log is not None or place < first_chunk  # which states the tip radius
        check_damaged(log, total=1800, worst=300)


def test_a_destroyed_stretch_costs_only_the_chunks_in_it(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=8, count=300)
    whole, ends = path.read_bytes(), chunk_ends(path)
    middle = len(ends) // 2
    start, stop = ends[middle][0] + 10, ends[middle + 4][0] - 10
    for filling in (bytes(stop - start), os.urandom(stop - start), b""):
        path.write_bytes(whole[:start] + filling + whole[stop:])
        log = read_log(path)
        check_damaged(log, total=2400, worst=900)
        assert len(log.trace) < 2400


def test_a_log_whose_beginning_is_destroyed_asks_for_the_tip_radius(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=3, count=300)
    damaged = bytearray(path.read_bytes())
    damaged[200] ^= 0xFF
    path.write_bytes(damaged)
    with pytest.raises(UserError, match=r"log\.mcap: field tip_radius.*--tip-radius"):
        read_log(path)
    log = read_log(path, tip_radius=0.02)
    assert log.trace.tip_radius == 0.02 and not log.complete and "damaged" in log.recovered
    assert_same_samples(log.trace, np.arange(900))


# --- bad input ------------------------------------------------------------------------------------------


def one_line(error: pytest.ExceptionInfo[UserError], *parts: str) -> None:
    assert "\n" not in str(error.value)
    for part in parts:
        assert part in str(error.value)


def test_a_log_with_no_samples_is_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        log.write(MOVE, trace_of(0, 0))
    for read in (read_log, lambda path: list(iter_log(path)), lambda path: load_logs([path])):
        with pytest.raises(UserError) as error:
            read(tmp_path / "log.mcap")
        one_line(error, "log.mcap", "samples")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.mcap", b"", "no intact message"),
        ("a.mcap", b"\x89PNG\r\n\x1a\n", "does not begin"),
        ("a.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG image"),
        ("a.mcap", log_format.MAGIC, "no intact message"),
        ("a.bin", bytes(range(256)), "binary"),
        ("a.csv", b"", "empty"),
    ],
)
def test_files_that_are_no_logs_are_refused_in_one_line(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError) as error:
        load_logs([tmp_path / name], tip_radius="1 mm")
    one_line(error, str(tmp_path / name), said)


def test_a_missing_log_and_a_folder_without_one_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(UserError) as error:
            load_logs([path])
        one_line(error, str(path))


def test_a_log_of_somebody_else_is_refused(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/x", "json", schema), 0, b"{}", 0)
        writer.finish()
    with pytest.raises(UserError) as error:
        read_log(tmp_path / "other.mcap")
    one_line(error, "other.mcap", "explore3d log")


def test_a_log_of_a_later_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_format, "VERSION", "explore3d/log/9")
    path = write_log(tmp_path / "log.mcap", moves=1)
    monkeypatch.undo()
    with pytest.raises(UserError) as error:
        read_log(path)
    one_line(error, "schema", "explore3d/log/9", log_format.VERSION)


def test_another_tip_radius_is_refused_in_writing_reading_and_merging(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "a.mcap", tip_radius=0.02) as log:
        with pytest.raises(UserError, match=r"0\.02"):
            log.write(MOVE, trace_of(0, 3))
        log.write(MOVE, Trace(np.arange(2), np.zeros((2, 3)), np.zeros(2, dtype=int), 0.02))
    with pytest.raises(UserError, match=r"0\.03 m is asked for, but the log states 0\.02"):
        read_log(tmp_path / "a.mcap", tip_radius=0.03)
    with pytest.raises(UserError, match="tip_radius"):
        read_log([write_log(tmp_path / "b.mcap", moves=1), tmp_path / "a.mcap"])


def test_an_existing_log_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_text("precious")
    with pytest.raises(UserError, match=r"log\.mcap"):
        LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS)
    assert (tmp_path / "log.mcap").read_text() == "precious"


def test_a_sweep_number_beyond_32_bits_is_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log, pytest.raises(UserError, match="sweep"):
        log.write(MOVE, trace_of(0, 3, sweep=2**31))


def test_values_that_json_cannot_keep_are_refused(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS) as log:
        with pytest.raises(TypeError, match="JSON"):
            log.event("x", {"value": object()})
        with pytest.raises(ValueError, match="JSON"):
            log.event("x", {"value": float("nan")})


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "open", lambda self, mode: open("/dev/full", "wb"))  # noqa: SIM115
    with pytest.raises(UserError, match="cannot write the log: No space left"):
        LogWriter(tmp_path / "log.mcap", tip_radius=RADIUS)


# --- several logs ---------------------------------------------------------------------------------------


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
            sys.path.insert(0, {str(Path(__file__).parent)!r})
            from test_explore3d_log import MOVE, RADIUS, trace_of
            from explore3d.log import LogWriter
            from explore3d.log_reader import iter_log
            with LogWriter({str(tmp_path / str(samples))!r}, tip_radius=RADIUS) as log:
                for first in range(0, {samples}, 20000):
                    log.write(MOVE, trace_of(first, 20000))
            assert sum(len(trace) for trace in iter_log({str(tmp_path / str(samples))!r})) == {samples}
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        """
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])}
        run = [sys.executable, "-c", textwrap.dedent(script)]
        return int(subprocess.run(run, env=environment, capture_output=True, check=True).stdout)

    assert peak(4_000_000) < peak(400_000) + 20_000  # kB
