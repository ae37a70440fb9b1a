"""Work-precision diagrams: achieved error over time, both logarithmic, one curve for each method."""

from __future__ import annotations

import io
from collections.abc import Sequence

from explore3d.figure import DPI, ESTIMATED, MUTED, TRUTH, new_figure, styled
from explore3d.work_precision import Point, Stage

COLOURS = (ESTIMATED, "#1d4e89", TRUTH, "#b7791f", "#6b46c1", MUTED, "#0e7490", "#9d174d")
MARKERS = "osD^vP*X"
DECADE = 10.0  # an axis shows at least so large a ratio: less would make much of little, and crowd its labels
SMALLEST = 1e-18  # an error of exactly nothing still needs a place on the axis


def diagram(stage: Stage, points: Sequence[Point]) -> dict[str, bytes]:
    """PNG and SVG of a stage; the finger's time beside the computer's where a finger moves."""
    clocks = [("computing time (s)", "seconds")]
    if any(point.finger for point in points):
        clocks.insert(0, ("time of the finger (s)", "finger"))
    with styled():
        figure = new_figure(4.4 * len(clocks) + 2.6, 3.7)
        every = figure.subplots(1, len(clocks), squeeze=False, sharey=True)[0]
        for axes, (label, clock) in zip(every, clocks, strict=True):
            for k, method in enumerate(dict.fromkeys(point.method for point in points)):
                own = [point for point in points if point.method == method]
                axes.plot(
                    [getattr(point, clock) for point in own], [max(point.error, SMALLEST) for point in own],
                    marker=MARKERS[k % len(MARKERS)], color=COLOURS[k % len(COLOURS)], markersize=5, label=method,
                )  # fmt: skip
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlabel(label)
            axes.set_xlim(*_widened(*axes.get_xlim()))
            axes.set_ylim(*_widened(*axes.get_ylim()))
        every[0].set_ylabel(stage.error.split(",")[0])
        figure.legend(*every[0].get_legend_handles_labels(), loc="outside right center")
        return {kind: _saved(figure, kind) for kind in ("png", "svg")}


def _widened(low: float, high: float) -> tuple[float, float]:
    """Limits about the same middle, a decade apart at least."""
    grow = max(1.0, (DECADE / (high / low)) ** 0.5)
    return low / grow, high * grow


def _saved(figure: object, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata = {"Software": None} if kind == "png" else {"Date": None}
    figure.savefig(stream, format=kind, dpi=DPI, facecolor="white", metadata=metadata)  # type: ignore[attr-defined]
    return stream.getvalue()
