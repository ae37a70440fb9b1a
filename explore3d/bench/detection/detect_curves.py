"""Detection curves: the table and the pictures of the detection bench."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.bench.detection.detect import DETECTORS, FALSE_ALARM_RATE, TIP_RADIUS, Cell
from explore3d.pictures import INK, MUTED, new_figure, png, styled
from mapping.geometry.mesh import write_whole

# Where a logarithmic axis shows that no false alarm was seen, 1/m.
NO_ALARMS_LEVEL = 1e-3
DETECTOR_COLOURS = dict(
    zip(DETECTORS, (INK, "#486581", "#829ab1", "#b7791f", "#6b46c1", "#c62828", "#1b7f4d"), strict=True)
)


def write_curves(cells: Sequence[Cell], out: Path) -> list[Path]:
    """Write detect.csv, detect.json and one picture for each feature and kind of noise into a folder.

    Raises:
        OSError: the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    written = [write_whole(out / "detect.csv", table(cells)), write_whole(out / "detect.json", as_json(cells))]
    for feature, kind in sorted({(c.feature, c.kind) for c in cells}):
        own = [c for c in cells if (c.feature, c.kind) == (feature, kind)]
        with styled():
            written.append(write_whole(out / f"detect_{feature}_{kind}.png", png(_picture(own, feature, kind))))
    return written


def table(cells: Sequence[Cell]) -> str:
    """The cells as CSV, one line each."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([field.name for field in fields(Cell)])
    writer.writerows([_short(value) for value in asdict(cell).values()] for cell in cells)
    return stream.getvalue()


def as_json(cells: Sequence[Cell]) -> str:
    """The cells as JSON with null for what is not a number."""
    rows = [{k: None if v != v else v for k, v in asdict(cell).items()} for cell in cells]
    return json.dumps(
        {"schema": "explore3d/bench_detect/1", "tip_radius": TIP_RADIUS, "rate": FALSE_ALARM_RATE, "cells": rows},
        indent=1,
    )


def _short(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value


def _picture(cells: list[Cell], feature: str, kind: str) -> Any:
    """Recall above, false alarms per metre below, one column for each level of noise."""
    noises, sizes = sorted({c.noise for c in cells}), sorted({c.size for c in cells})
    alone = len(noises) == 1  # a narrow figure: its legend needs more rows
    figure = new_figure(4.6 if alone else 3.4 * len(noises) + 0.6, 5.8 if alone else 5.2)
    axes = figure.subplots(2, len(noises), sharex=True, squeeze=False)
    for column, noise in enumerate(noises):
        recall, alarms = axes[:, column]
        own = sorted((c for c in cells if c.noise == noise), key=lambda c: c.size)
        for detector in DETECTORS:
            line = [c for c in own if c.detector == detector]
            # the widest first, so that curves on one another all show
            width = 1.0 + 0.5 * (len(DETECTORS) - DETECTORS.index(detector))
            style: dict[str, Any] = {
                "color": DETECTOR_COLOURS[detector],
                "marker": "o",
                "ms": 3,
                "lw": width,
                "label": detector,
            }
            recall.plot([c.size for c in line], [c.recall for c in line], **style)
            alarms.plot([c.size for c in line], [max(c.false_alarms_per_metre, NO_ALARMS_LEVEL) for c in line], **style)
        bound = [c for c in own if c.detector == DETECTORS[0] and np.isfinite(c.bound)]
        if bound:
            recall.plot(
                [c.size for c in bound], [c.bound for c in bound], "--", color=MUTED, label="matched-filter bound"
            )
        alarms.axhline(FALSE_ALARM_RATE, color=MUTED, lw=0.8, ls=":", label="false alarms asked for")
        recall.set(title=f"noise / r = {noise:g}, {kind}", ylim=(-0.03, 1.03), xscale="log")
        alarms.set(
            yscale="log", ylim=(NO_ALARMS_LEVEL / 2, 1e4), xlabel="diameter / r" if feature == "wire" else "width / r"
        )
        alarms.set_xticks(sizes, [f"{size:g}" for size in sizes])
        alarms.set_xticks([], minor=True)
        alarms.set_yticks([NO_ALARMS_LEVEL, 1e-2, 1, 1e2, 1e4], ["none", "0.01", "1", "100", "10 000"])
    axes[0, 0].set_ylabel(f"recall of a {feature}")
    axes[1, 0].set_ylabel("false alarms per metre")
    pairs = [pair for panel in axes[:, 0] for pair in zip(*panel.get_legend_handles_labels(), strict=True)]
    entries = {label: handle for handle, label in pairs}
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=2 if alone else 4)
    return figure
