"""A log is readable whatever happened to the program that wrote it or to the file."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from sample_logs import MOVE, RADIUS, assert_same_samples, numbers_of, trace_of, write_log

from explore3d.errors import UserError
from explore3d.log.own import point_cloud
from explore3d.log.own.chunks import Damage, intact_chunks
from explore3d.log.own.reader import read_log
from explore3d.log.own.record import Log
from explore3d.log.own.writer import LogWriter

WRITER = textwrap.dedent(
    """
    import sys
    sys.path.insert(0, {tests!r})
    from sample_logs import MOVE, RADIUS, trace_of
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
    script = WRITER.format(tests=str(Path(__file__).parents[3] / "support" / "logs"), path=str(path))
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[4]), "OMP_NUM_THREADS": "1"}
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


def test_a_log_survives_the_loss_of_any_one_chunk(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=4, count=300)
    whole, ends = path.read_bytes(), [end for end, _ in chunk_ends(path)]
    for end in ends:
        damaged = bytearray(whole)
        damaged[end - 20 : end] = bytes(20)
        path.write_bytes(damaged)
        log = read_log(path)
        assert log.scene_text == "seed = 1\n" and log.trace.tip_radius == RADIUS
        check_damaged(log, total=1200, worst=300)
        assert sum(event.kind == "move" for event in log.events) >= 7
    # both of the first two: the third stands at the end
    damaged = bytearray(whole)
    damaged[: ends[1]] = bytes(ends[1])
    path.write_bytes(damaged)
    assert len(read_log(path).trace) == 1200 and read_log(path).trace.tip_radius == RADIUS


class Counted(io.BytesIO):
    """A file that counts the bytes that are read of it, as requests for ranges would."""

    fetched = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.fetched += len(data)
        return data


def test_the_plan_of_a_long_log_is_had_for_kilobytes(tmp_path: Path) -> None:
    from mcap.reader import SeekingReader

    path = write_log(tmp_path / "log.mcap", moves=15, count=40_000)
    with Counted(path.read_bytes()) as file:
        reader = SeekingReader(file)
        moves = [json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/move", "/start"])]
        count = file.fetched
    print(f"{count} of {path.stat().st_size} bytes")
    assert len(moves) == 33 and moves[0]["tip_radius"] == RADIUS
    assert path.stat().st_size > 8e6 and count < 120e3


@pytest.mark.parametrize("kept", ["the move alone", "the move and a part of its samples"])
def test_what_was_felt_counts_where_the_samples_of_the_move_did_not_reach_the_disk(tmp_path: Path, kept: str) -> None:
    path = tmp_path / "log.mcap"
    with LogWriter(path, tip_radius=RADIUS) as log:
        log.write(MOVE, trace_of(0, 100))
        log.felt(trace_of(100, 60_000, 1))
        before = path.stat().st_size
        log.write(MOVE, trace_of(100, 60_000, 1))
    ends = [end for end, _ in chunk_ends(path) if end > before]
    path.write_bytes(path.read_bytes()[: ends[0 if kept == "the move alone" else 1]])
    log = read_log(path)
    assert_same_samples(log.trace, np.arange(60_100))
    assert not log.complete and "broken off" in log.recovered


def test_a_log_whose_every_start_is_destroyed_asks_for_the_tip_radius(tmp_path: Path) -> None:
    path = write_log(tmp_path / "log.mcap", moves=3, count=300)
    damaged, ends = bytearray(path.read_bytes()), [end for end, _ in chunk_ends(path)]
    for end in (*ends[:2], *ends[-2:]):
        damaged[end - 20 : end] = bytes(20)
    path.write_bytes(damaged)
    with pytest.raises(UserError, match=r"log\.mcap: field tip_radius.*--tip-radius"):
        read_log(path)
    log = read_log(path, tip_radius=0.02)
    assert log.trace.tip_radius == 0.02 and not log.complete and "damaged" in log.recovered
    assert_same_samples(log.trace, np.arange(900))
