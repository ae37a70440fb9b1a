"""Figure: matplotlib without a screen, in the report's own style, returned as PNG bytes."""

from __future__ import annotations

import io
from typing import Any

INK = "#1f2933"
MUTED = "#7b8794"
FAINT = "#e4e7eb"
TRACED = "#829ab1"
ESTIMATED = "#c62828"
TRUTH = "#1b7f4d"
BAND = "#f4c7c3"
DPI = 160

FIGURE_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
}


def new_figure(width: float, height: float) -> Any:
    """An empty figure of width x height inches that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def styled() -> Any:
    """The style as a context: `with styled(): ...` around drawing and saving."""
    from matplotlib import rc_context

    return rc_context(FIGURE_STYLE)


def png(figure: Any) -> bytes:
    """The figure as a PNG file; the same figure gives the same bytes."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", facecolor="white", metadata={"Software": None})
    return stream.getvalue()
