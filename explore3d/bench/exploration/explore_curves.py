"""Curves of the exploration bench: error against finger time and computing time, and times at equal error."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.pictures import ESTIMATED, MUTED, TRACED, TRUTH, new_figure, png, styled
from mapping.geometry.mesh import write_whole

Record = dict[str, Any]
STRATEGY_COLOURS = {"explore": ESTIMATED, "raster": TRACED, "random": MUTED, "ergodic": TRUTH}


@dataclass(frozen=True)
class Summary:
    """One strategy on one scene, over its seeds.

    Args:
        right: runs in which every feature was found and rightly typed, and none invented.
        finger_seconds, compute_seconds: medians, s.
        error: median over the runs of the largest error of an end (of a place, where nothing has ends), m; infinite
            where half of the runs miss a feature.
        worst: the largest of these errors, m.
        axis_rms: median, m.
    """

    scene: str
    strategy: str
    runs: int
    right: int
    finger_seconds: float
    compute_seconds: float
    error: float
    worst: float
    axis_rms: float


def summaries(records: Sequence[Record]) -> list[Summary]:
    """Every strategy on every scene, in the order of the records."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record["scene"], record["strategy"]), []).append(record)
    return [_summary(scene, strategy, runs) for (scene, strategy), runs in groups.items()]


def _summary(scene: str, strategy: str, runs: list[Record]) -> Summary:
    errors = np.array([_error(run) for run in runs])
    rms = [run["axis_rms"] for run in runs if run["axis_rms"] is not None]
    return Summary(
        scene,
        strategy,
        len(runs),
        sum(_right(run) for run in runs),
        float(np.median([run["finger_seconds"] for run in runs])),
        float(np.median([run["planning_seconds"] + run["modelling_seconds"] for run in runs])),
        _median(errors),
        float(errors.max()),
        float(np.median(rms)) if rms else nan,
    )


def _median(values: np.ndarray) -> float:
    """The median where some values are infinite."""
    ordered = np.sort(values)
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return float(high if np.isinf(high) else 0.5 * (low + high))


def _right(run: Record) -> bool:
    return run["found"] == run["true"] and not (run["mistyped"] or run["missed"] or run["invented"])


def _error(run: Record) -> float:
    """Largest error of an end or, where no feature has one, of an axis; infinite if a feature was missed, m."""
    if run["missed"]:
        return inf
    error = run["axis_rms"] if run["end_error"] is None else run["end_error"]
    return nan if error is None else float(error)


@dataclass(frozen=True)
class Lead:
    """How much longer another family of strategies takes on a scene for the explorer's error.

    `ratio` is its finger time over the explorer's; `at_least` says that even its longest run was less exact.
    """

    scene: str
    family: str
    ratio: float
    at_least: bool


def leads(rows: Sequence[Summary]) -> list[Lead]:
    """The explorer's lead over every family on every scene with features."""
    found = []
    for mine in (row for row in rows if row.strategy == "explore" and np.isfinite(row.error)):
        for family in ("raster", "random", "ergodic"):
            others = [row for row in rows if row.scene == mine.scene and row.strategy.startswith(family)]
            if others:
                seconds, at_least = seconds_at(mine.error, others)
                found.append(Lead(mine.scene, family, seconds / mine.finger_seconds, at_least))
    return found


def seconds_at(error: float, rows: Sequence[Summary]) -> tuple[float, bool]:
    """Least finger time (s) in which strategies reach an error (m), and whether it is only a lower bound.

    Straight lines in the logarithms of time and error join neighbouring times; the longest run bounds the time from
    below where it is less exact.
    """
    ordered = sorted(rows, key=lambda row: row.finger_seconds)
    for k, row in enumerate(ordered):
        if row.error > error:
            continue
        before = ordered[k - 1] if k else row
        if not np.isfinite(before.error) or before.error <= row.error:
            return row.finger_seconds, False
        share = np.log(before.error / error) / np.log(before.error / row.error)
        times = np.log([before.finger_seconds, row.finger_seconds])
        return float(np.exp(times[0] + share * (times[1] - times[0]))), False
    return ordered[-1].finger_seconds, True


def write_curves(records: Sequence[Record], folder: Path) -> list[Path]:
    """The table as CSV and JSON, and a picture per scene; returns the files."""
    rows = summaries(records)
    folder.mkdir(parents=True, exist_ok=True)
    about = {"summaries": [asdict(row) for row in rows], "leads": [asdict(lead) for lead in leads(rows)]}
    files = {"explore.csv": _csv(rows).encode(), "explore.json": json.dumps(about, indent=1).encode()}
    for scene in dict.fromkeys(row.scene for row in rows):
        files[f"explore_{scene.replace(' ', '_')}.png"] = picture([row for row in rows if row.scene == scene])
    for name, content in files.items():
        write_whole(folder / name, content)
    return [folder / name for name in files]


def _csv(rows: Sequence[Summary]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(Summary.__dataclass_fields__))
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return stream.getvalue()


def picture(rows: Sequence[Summary]) -> bytes:
    """PNG: one scene's error against finger time and against computing time."""
    with styled():
        figure = new_figure(8.0, 3.2)
        axes = figure.subplots(1, 2, sharey=True)
        for family, colour in STRATEGY_COLOURS.items():
            some = sorted((r for r in rows if r.strategy.startswith(family)), key=lambda r: r.finger_seconds)
            some = [row for row in some if np.isfinite(row.error)]
            for axis, name in zip(axes, ("finger_seconds", "compute_seconds"), strict=True):
                times, errors = [getattr(row, name) for row in some], [1e3 * row.error for row in some]
                axis.plot(times, errors, "o-" if name == "finger_seconds" else "o", color=colour, label=family)
        for axis, label in zip(axes, ("finger time (s)", "computing time (s)"), strict=True):
            axis.set(xscale="log", yscale="log", xlabel=label)
        axes[0].set(ylabel="error of the ends (mm)", title=rows[0].scene)
        axes[1].legend()
        return png(figure)
