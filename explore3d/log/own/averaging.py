"""averaged_log: a long recording as the means of runs of its samples, and what that does to noise and crests."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError, count_text
from explore3d.log.own.memory import must_fit_analysis
from explore3d.log.own.reader import as_log
from explore3d.log.own.record import Event, Log
from explore3d.log.own.stream import LogStream, count_samples
from mapping import BoolArray, FloatArray, IntArray, Trace, length_text
from mapping.instrument import RunMeans

SAMPLE_GAP = 5.0  # usual steps: a longer one within a sweep is a gap, samples were lost or left out there
NEIGHBOURS = np.array([-2, -1, 1, 2])  # steps beside one: a jump stands alone, a faster sweep does not
PIECE_SAMPLES = 1_000_000  # of a log that are averaged at a time
VECTOR_FIELDS = ("normals", "contacts", "force")


def averaged_log(log: Log, length: int) -> Log:
    """The same log with each run of so many samples as one, their mean.

    No run goes over the end of a sweep, a gap, a step back of the clock, or a turn of the path (RunMeans).

    Args:
        log: a recording whose samples are all in memory.
        length: samples of a run.

    Raises:
        UserError: no run is left.
    """
    trace, first, about = _averaged([log.trace], length, ", ".join(log.sources))
    return _told(replace(log, trace=trace), first, about)


def averaged_file(path: Path, tip_radius: float | None, length: int) -> Log:
    """The same of a log's file, in memory that does not grow with it.

    Raises:
        UserError: as read_log, and averaged_log; more samples than the memory takes.
    """
    must_fit_analysis(path, count_samples(path) / length, length)
    stream = LogStream(path, tip_radius)
    trace, first, about = _averaged(stream.sweeps(PIECE_SAMPLES), length, str(path))
    return _told(as_log(trace, stream.reading), first, about)


def _averaged(traces: Iterable[Trace], length: int, name: str) -> tuple[Trace, IntArray, dict[str, Any]]:
    means, found, firsts, last = RunMeans(length), list[FloatArray](), list[IntArray](), None
    step = tick = 0.0
    cuts = rows = 0
    some: Trace | None = None
    for trace in traces:
        vectors = [getattr(trace, field) for field in VECTOR_FIELDS if getattr(trace, field) is not None]
        table = np.column_stack([trace.centers, trace.t, trace.sweep, *vectors])
        joined = table if last is None else np.concatenate([last[None], table])
        steps, ticks = step_lengths(joined), np.diff(joined[:, 3])
        if some is None:
            some, step, tick = trace, usual_step(steps), usual_step(ticks)
        cut = (np.diff(joined[:, 4]) != 0) | lone_steps(steps, SAMPLE_GAP * step)
        cut |= (ticks < 0.0) | (ticks > SAMPLE_GAP * tick)
        cut = np.append(False, cut) if last is None else cut
        taken = means.add(table, cut)
        found.append(taken.values)
        firsts.append(taken.first)
        last, cuts, rows = table[-1], cuts + int(cut.sum()), rows + len(table)
    assert some is not None  # a log without a sample was refused while it was read
    taken = means.rest()
    values, first = np.concatenate([*found, taken.values]), np.concatenate([*firsts, taken.first])
    if not len(values):
        raise UserError(f"{name}: field average: no sweep has as many as {length // 2} samples in a row")
    columns = np.split(values, [3, 4, 5, *range(8, values.shape[1], 3)], axis=1)
    names = [field for field in VECTOR_FIELDS if getattr(some, field) is not None]
    more = dict(zip(names, columns[3:], strict=True))
    if "normals" in more:
        more["normals"] = unit_vectors(more["normals"])
    sweep = np.rint(columns[2][:, 0]).astype(np.int64)
    trace = Trace(columns[1][:, 0], columns[0], sweep, some.tip_radius, **more, resolution=some.resolution)
    return trace, first, about_averaging(means, trace.centers, sweep, some.tip_radius, rows, cuts)


def _told(log: Log, first: IntArray, about: dict[str, Any]) -> Log:
    """The log with its events at the new samples, and a word on what was done."""

    def moved(event: Event) -> Event:
        if event.kind != "move" or "first" not in event.data:
            return event
        begin, end = np.searchsorted(first, [event.data["first"], event.data["first"] + event.data["samples"]])
        return replace(event, data=event.data | {"first": int(begin), "samples": int(end - begin)})

    short = about["rows_left_out"]
    left = [f"{short:,} samples are left out, in stretches of fewer than half of {about['length']}"] * bool(short)
    return replace(
        log,
        events=tuple(map(moved, log.events)),
        metadata=log.metadata
        | {"average": about, "read_as": [*log.metadata.get("read_as", []), averaging_words(about)]},
        recovered="; ".join(filter(None, [log.recovered, *left])),
    )


def about_averaging(
    means: RunMeans, centers: FloatArray, sweep: IntArray, radius: float, rows: int, cuts: int
) -> dict[str, Any]:
    """What averaging did, as JSON values, and what it costs; lengths in m.

    A sharp crest of height H has a contact half-width of sqrt(2 r H) (theory section 4.2): as long as the samples lie
    apart for H = d^2 / (2 r); the mean of a ball's parabola over d lies d^2 / (24 r) below its top.

    Args:
        means: that took the runs.
        centers, sweep: (M, 3) and (M,) of what became of them.
        radius: of the tip, m.
        rows: samples that it was given.
        cuts: of them that follow a gap, or an end.
    """
    steps = step_lengths(centers)[np.diff(sweep) == 0]
    spacing = float(np.median(steps)) if len(steps) else 0.0
    return {
        "length": means.length,
        "samples": len(centers),
        "rows": rows,
        "rows_left_out": means.left_out,
        "cuts": cuts,
        "turns": means.turns,
        "spacing": spacing,
        "white_noise": float(means.length**-0.5),
        "smallest_crest": spacing**2 / (2.0 * radius),
        "lowered": spacing**2 / (24.0 * radius),
    }


def averaging_words(about: dict[str, Any]) -> str:
    """The same for people."""
    spacing = length_text(about["spacing"])
    cuts = (("cuts", "gap or end", "gaps and ends"), ("turns", "turn", "turns"))
    places = " and ".join(count_text(about[key], one, several) for key, one, several in cuts if about[key])
    cut = f"cut at {places}" if places else "cut nowhere"
    return (
        f"averaged: {about['samples']:,} samples are the means of {about['length']} each, {cut}; white noise falls to "
        f"{about['white_noise']:.3g} of it, what is correlated over more than {spacing} does not; crests lower than "
        f"{length_text(about['smallest_crest'])} are smeared, tops lie up to {length_text(about['lowered'])} too low"
    )


def step_lengths(points: FloatArray) -> FloatArray:
    """(N - 1,) distance of each position, the first three columns, from the one before it."""
    squares = np.diff(points[:, 0]) ** 2
    for axis in (1, 2):
        squares += np.diff(points[:, axis]) ** 2
    return np.asarray(np.sqrt(squares))


def usual_step(steps: FloatArray) -> float:
    """The median of those that are steps forward, 0 if none is."""
    moving = steps[steps > 0.0]
    return float(np.median(moving)) if len(moving) else 0.0


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """(N, 3) of length 1, as the mean of unit vectors is not."""
    length = np.linalg.norm(vectors, axis=1)[:, None]
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def lone_steps(steps: FloatArray, least: float) -> BoolArray:
    """(N,) the steps that are longer than `least`, and by as much longer than those around them: no faster sweep."""
    found: BoolArray = np.zeros(len(steps), dtype=np.bool_)
    if not least > 0.0:
        return found
    long = np.flatnonzero(steps > least)
    around = np.median(steps[np.clip(long[:, None] + NEIGHBOURS, 0, len(steps) - 1)], axis=1)
    found[long] = steps[long] > SAMPLE_GAP * around
    return found
