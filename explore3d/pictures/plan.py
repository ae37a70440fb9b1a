"""Picture of a plan: the sweeps that the finger would make, in the order of time, and the moves that break a limit."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from explore3d import count_text, seconds_text
from explore3d.pictures.camera import Camera
from explore3d.pictures.figure import DPI, ESTIMATED, INK, MUTED, new_figure, png, styled
from explore3d.pictures.object import (
    PICTURE_BASE_COLOUR,
    SUPERSAMPLING,
    cameras_for,
    pixel_size,
    round_length,
    view_directions,
)
from explore3d.pictures.render import Body, Picture, render
from explore3d.pictures.sweep_paths import densified
from hw import Move
from mapping import FloatArray, length_text
from mapping.base import Base

AIR = np.array([0.72, 0.76, 0.80])
WRONG = np.array([0.78, 0.16, 0.16])
TIME_COLOURMAP = "viridis"
TITLE_ROOM = 0.5  # inches


def plan_picture(base: Base, moves: Sequence[Move], tip_radius: float, violations: Collection[int] = ()) -> bytes:
    """PNG of the base with every move: sweeps coloured by their time, ways through the air grey.

    Args:
        base: the global model.
        moves: in their order.
        tip_radius: m.
        violations: numbers of the moves, from 0, that break a limit; drawn in red.
    """
    paths = [move.path for move in moves]
    points = np.concatenate([np.zeros((0, 3)), *paths])
    feet = base.foot(points, tip_radius)
    views = view_directions(feet.normals, (), base.surface)
    shown = np.concatenate([base.surface.bounds, points]) if len(points) else base.surface.bounds
    corners = np.stack(np.meshgrid(*np.stack([shown.min(axis=0), shown.max(axis=0)]).T), axis=-1).reshape(-1, 3)
    times = np.concatenate([[0.0], np.cumsum([move.duration for move in moves])])
    with styled():
        figure, panels = _panels(cameras_for(corners, views))
        for axes, camera in panels:
            picture = render([Body(base.surface, PICTURE_BASE_COLOUR)], camera)
            for number, move in enumerate(moves):
                share = times[number : number + 2] / (times[-1] or 1.0)
                _draw(picture, move, base, tip_radius, number in violations, share)
            axes.imshow(picture.reduced(SUPERSAMPLING), interpolation="none")
            _draw_scale_bar(axes, camera)
        _legend(figure, [axes for axes, _ in panels], moves, float(times[-1]), len(violations))
        return png(figure)


def _panels(cameras: Sequence[Camera]) -> tuple[Any, list[tuple[Any, Camera]]]:
    """A figure with one panel beside the other, each of its camera's shape, and some room above."""
    tallest = max(camera.height for camera in cameras) / SUPERSAMPLING / DPI
    figure = new_figure(sum(camera.width for camera in cameras) / SUPERSAMPLING / DPI, tallest + TITLE_ROOM)
    panels = np.atleast_1d(figure.subplots(1, len(cameras)))
    for axes in panels:
        axes.set_axis_off()
    return figure, list(zip(panels, cameras, strict=True))


def _draw_scale_bar(axes: Any, camera: Camera) -> None:
    length, wide = round_length(camera)
    height, width = camera.height / SUPERSAMPLING, camera.width / SUPERSAMPLING
    left, row = 0.03 * width, 0.965 * height
    axes.plot([left, left + wide], [row, row], color=INK, linewidth=2.0, solid_capstyle="butt")
    axes.text(left, row - 0.012 * height, length_text(length), color=INK, fontsize=8.5, va="bottom")


def _draw(picture: Picture, move: Move, base: Base, tip_radius: float, wrong: bool, share: FloatArray) -> None:
    from matplotlib import colormaps

    pixel = pixel_size(picture.camera)
    path = densified(move.path, 0.5 * pixel)
    if move.purpose == "sweep":
        feet = base.foot(path, tip_radius)
        path = feet.points + 2.0 * pixel * feet.normals
    colours = colormaps[TIME_COLOURMAP](np.linspace(share[0], share[1], len(path)))[:, :3]
    if move.purpose != "sweep":
        colours = np.broadcast_to(AIR, path.shape)
    picture.splat(path, np.broadcast_to(WRONG, path.shape) if wrong else colours, 2.6 if wrong else 2.0, 3.0 * pixel)


def _legend(figure: Any, panels: Any, moves: Sequence[Move], seconds: float, wrong: int) -> None:
    """What the plan costs, and a bar of the colours' time."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    sweeps = [move for move in moves if move.purpose == "sweep"]
    length = length_text(sum(move.length for move in sweeps))
    verdict = f"{count_text(wrong, 'move')} against a limit, in red" if wrong else "no move breaks a limit"
    figure.suptitle(
        f"{count_text(len(sweeps), 'sweep')}, {length} long, {seconds_text(seconds)} of moves; {verdict}",
        x=0.02, ha="left", fontsize=10, color=ESTIMATED if wrong else INK,
    )  # fmt: skip
    scale = ScalarMappable(Normalize(0.0, seconds or 1.0), TIME_COLOURMAP)
    bar = figure.colorbar(scale, ax=panels, shrink=0.5, aspect=30, pad=0.01)
    bar.set_label("time of the sweep (s)", color=MUTED)
    bar.outline.set_visible(False)
