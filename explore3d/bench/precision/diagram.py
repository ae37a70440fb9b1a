"""Work-precision diagrams: achieved error over time, both logarithmic, one curve for each method."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

from explore3d.bench.precision.work_precision import Point, Stage
from explore3d.pictures import DPI, ESTIMATED, MUTED, TRUTH, new_figure, styled
from mapping import length_text

CURVE_COLOURS = (ESTIMATED, "#1d4e89", TRUTH, "#b7791f", "#6b46c1", MUTED, "#0e7490", "#9d174d")
MARKERS = "osD^vP*X"
BETTER_CORNER_LABEL = "\u2199 faster and more exact"
FEW_DECADES = 60.0  # ratio of an axis' ends below which decades alone are too few labels
DECADE = 10.0  # an axis shows at least so large a ratio: less would make much of little, and crowd its labels
SMALLEST_DRAWN_ERROR = 1e-18  # an error of exactly nothing still needs a place on the axis


def diagram(stage: Stage, points: Sequence[Point]) -> dict[str, bytes]:
    """PNG and SVG of a stage; the finger's time beside the computer's where a finger moves."""
    clocks = [("computing time (s)", "seconds")]
    if any(point.finger for point in points):
        clocks.insert(0, ("time of the finger (s)", "finger"))
    methods = sorted(dict.fromkeys(point.method for point in points), key=lambda name: "ours" not in name)
    metres = "(m)" in stage.error.split(",")[0]
    with styled():
        figure = new_figure(4.4 * len(clocks) + 2.6, 3.9)
        every = figure.subplots(1, len(clocks), squeeze=False, sharey=True)[0]
        for axes, (label, clock) in zip(every, clocks, strict=True):
            for k, method in enumerate(methods):
                own = [point for point in points if point.method == method]
                _curve(axes, own, clock, MARKERS[k % len(MARKERS)], CURVE_COLOURS[k % len(CURVE_COLOURS)])
            axes.set(xscale="log", yscale="log", xlabel=label)
            axes.set_xlim(*_widened(*axes.get_xlim()))
            axes.set_ylim(*_widened(*axes.get_ylim()))
            _ticks(axes.xaxis, lambda value: f"{value:g}")
            _ticks(axes.yaxis, (lambda value: length_text(value, 1)) if metres else lambda value: f"{value:g}")
            axes.text(0.02, 0.02, BETTER_CORNER_LABEL, transform=axes.transAxes, color=MUTED, fontsize=8)
        every[0].set_ylabel(stage.error.split(",")[0].replace(" (m)", ""))
        figure.legend(*every[0].get_legend_handles_labels(), loc="outside right center")
        return {kind: _saved(figure, kind) for kind in ("png", "svg")}


def _curve(axes: Any, points: Sequence[Point], clock: str, marker: str, colour: str) -> None:
    """One method: its points in the order of its settings, the first and the last of them named."""
    times, errors = (
        [getattr(point, clock) for point in points],
        [max(point.error, SMALLEST_DRAWN_ERROR) for point in points],
    )
    axes.plot(times, errors, marker=marker, color=colour, markersize=5, label=points[0].method)
    near = {"textcoords": "offset points", "ha": "center", "color": colour, "fontsize": 6}
    axes.annotate(points[0].setting, (times[0], errors[0]), xytext=(0, 6), **near)
    if len(points) > 1:
        axes.annotate(points[-1].setting, (times[-1], errors[-1]), xytext=(0, -11), **near)


def _ticks(axis: Any, text: Callable[[float], str]) -> None:
    """Labels that are read without counting exponents: each decade, and 2 and 5 where there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < FEW_DECADES * low else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axis.set_minor_formatter(NullFormatter())


def _widened(low: float, high: float) -> tuple[float, float]:
    """Limits about the same middle, a decade apart at least."""
    grow = max(1.0, (DECADE / (high / low)) ** 0.5)
    return low / grow, high * grow


def _saved(figure: object, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata = {"Software": None} if kind == "png" else {"Date": None}
    figure.savefig(stream, format=kind, dpi=DPI, facecolor="white", metadata=metadata)  # type: ignore[attr-defined]
    return stream.getvalue()
