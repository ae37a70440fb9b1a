"""Shape picture: the courses of each shape, and what was told of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.bench.detection.shapes import shape_lines
from explore3d.pictures import ESTIMATED, FAINT, MUTED, new_figure, png, styled
from mapping.geometry.mesh import write_whole

COLUMNS = 5
# Colours of features in turn: side by side they are told apart
FEATURE_COLOURS = (ESTIMATED, "#1b7f4d", "#6b46c1", "#b7791f", "#2b6cb0")


def write_shapes(records: Sequence[dict[str, Any]], out: Path) -> list[Path]:
    """Write shapes.csv, and shapes.png of the first trial of each shape, into a folder.

    Raises:
        OSError: the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    table = "".join(f"{line}\n" for line in shape_lines(records))
    with styled():
        return [write_whole(out / "shapes.csv", table), write_whole(out / "shapes.png", png(_picture(records)))]


def _picture(records: Sequence[dict[str, Any]]) -> Any:
    """A panel for each shape: its courses in grey, the axes that were told in colours."""
    names = list(dict.fromkeys(record["shape"] for record in records))
    rows = -(-len(names) // COLUMNS)
    figure = new_figure(2.0 * COLUMNS, 2.3 * rows)
    panels = list(figure.subplots(rows, COLUMNS, squeeze=False).flat)
    for panel in panels:
        panel.set_axis_off()
    for name, panel in zip(names, panels, strict=False):
        own = [record for record in records if record["shape"] == name]
        for course in own[0]["courses"]:
            _draw(panel, course, color=FAINT, lw=6.0, ms=8.0)
        for number, axis in enumerate(own[0]["axes"]):
            _draw(panel, axis, color=FEATURE_COLOURS[number % len(FEATURE_COLOURS)], lw=1.2, ms=4.0)
        right = sum(record["judged"] in ("right", "flagged") for record in own)
        panel.set_title(f"{name}: {right} of {len(own)}", fontsize=8)
        panel.text(0.5, -0.02, own[0]["judged"], transform=panel.transAxes, ha="center", fontsize=7, color=MUTED)
        panel.set(xlim=(-20.0, 20.0), ylim=(-20.0, 20.0), aspect="equal")
    return figure


def _draw(panel: Any, axis: Sequence[Sequence[int]], **style: Any) -> None:
    """A course, or a point, given in micrometres, in mm."""
    x, y = 1e-3 * np.array(axis, dtype=np.float64).T
    panel.plot(x, y, "o" if len(x) == 1 else "-", solid_capstyle="round", **style)
