"""Picture of the object: its base, the sweeps over it, and the features found, seen by rays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from explore3d.pictures.camera import Camera
from explore3d.pictures.figure import DPI, INK, new_figure, png, styled
from explore3d.pictures.raycast import Body, Picture, render
from explore3d.pictures.sweep_paths import SweepPath, densified
from mapping import Feature, FloatArray, Surface, length_text
from mapping.inference.kinds import kind_of
from mapping.model import drawn_at_least, feature_mesh

# Width of a picture of one panel, and of each of two, pixels; and the most that a panel is high for its width.
WIDTHS = {1: 1080, 2: 760}
TALLEST = 0.8
SUPERSAMPLING = 2
PICTURE_BASE_COLOUR = np.array([0.86, 0.88, 0.91])
QUIET = np.array([0.42, 0.52, 0.62])
LOUD = np.array([0.93, 0.55, 0.13])
# Features are drawn at least so many pixels wide, or nobody would see them.
LEAST_FEATURE_PIXELS = 5.0
# A body whose outward directions cancel more than this is round: it needs two views.
ROUND = 0.45


def object_picture(base: Surface, features: Sequence[Feature], sweeps: Sequence[SweepPath]) -> bytes:
    """PNG of the base with sweeps and features; two opposite views of a round body.

    What the sweeps noticed is drawn in orange.
    """
    normals = np.concatenate([np.zeros((0, 3)), *(path.normals for path in sweeps)])
    shown = _close_up(base, np.concatenate([np.zeros((0, 3)), *(path.points for path in sweeps)]))
    with styled():
        figure, panels = panels_for(cameras_for(shown, view_directions(normals, features)))
        for axes, camera in panels:
            _draw(axes, _scene(base, features, camera, sweeps), features)
        return png(figure)


def pixel_size(camera: Camera) -> float:
    """Size of a pixel at the distance of the camera's target, m."""
    return camera.pixel * float(np.linalg.norm(camera.eye - camera.target))


def cameras_for(points: FloatArray, directions: Sequence[FloatArray]) -> list[Camera]:
    """One camera a panel, each against a direction, that show all points (N, 3)."""
    width = WIDTHS[len(directions)] * SUPERSAMPLING
    return [Camera.facing(points, each, width, round(TALLEST * width)) for each in directions]


def panels_for(cameras: Sequence[Camera], room: float = 0.0) -> tuple[Any, list[tuple[Any, Camera]]]:
    """A figure with one panel beside the other, each of its camera's shape, and `room` inches besides."""
    tallest = max(camera.height for camera in cameras) / SUPERSAMPLING / DPI
    figure = new_figure(sum(camera.width for camera in cameras) / SUPERSAMPLING / DPI, tallest + room)
    panels = np.atleast_1d(figure.subplots(1, len(cameras)))
    for axes in panels:
        axes.set_axis_off()
    return figure, list(zip(panels, cameras, strict=True))


def view_directions(normals: FloatArray, features: Sequence[Feature]) -> list[FloatArray]:
    """Directions towards the camera: one, oblique, over a flat body; two opposite ones round a closed body."""
    mean = normals.mean(axis=0) if len(normals) else np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(mean) > ROUND:
        mean = mean / np.linalg.norm(mean)
        across = np.cross(np.array([0.0, 0.0, 1.0]), mean)
        across = across / np.linalg.norm(across) if np.linalg.norm(across) > 1e-3 else np.array([1.0, 0.0, 0.0])
        down = np.cross(mean, across)
        return [np.asarray(mean - 0.75 * down * np.sign(down[2] or 1.0) + 0.35 * across)]
    outward = [feature.normals.mean(axis=0) for feature in features] or [np.array([1.0, -1.0, 0.0])]
    angle = np.arctan2(outward[0][1], outward[0][0]) - 0.5
    first = np.array([np.cos(angle), np.sin(angle), 0.45])
    return [first, first * [-1.0, -1.0, 1.0]]


def _close_up(base: Surface, feet: FloatArray) -> FloatArray:
    """What the camera must show: the base, or the explored part if that is much smaller."""
    corners = base.vertices[np.unique(base.faces)]
    explored = np.stack([feet.min(axis=0), feet.max(axis=0)]) if len(feet) else corners
    if np.linalg.norm(np.ptp(explored, axis=0)) > 0.4 * base.size or len(feet) == 0:
        return corners
    middle, reach = explored.mean(axis=0), 0.6 * np.linalg.norm(np.ptp(explored, axis=0))
    return np.asarray(middle + reach * (np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)))


def _scene(base: Surface, features: Sequence[Feature], camera: Camera, sweeps: Sequence[SweepPath]) -> Picture:
    pixel = pixel_size(camera)
    bodies = [Body(base, PICTURE_BASE_COLOUR)]
    for feature in features:
        colour = np.array(kind_of(feature).colour[:3])
        bodies.append(Body(feature_mesh(drawn_at_least(feature, LEAST_FEATURE_PIXELS * SUPERSAMPLING * pixel)), colour))
    picture = render(bodies, camera)
    for path in sweeps:
        line = densified(path.points + 2.0 * pixel * path.normals, 0.5 * pixel)
        picture.splat(line, QUIET, 1.3, 3.0 * pixel)
    for path in sweeps:
        for part in np.split(np.arange(len(path.points)), np.flatnonzero(np.diff(path.noticed)) + 1):
            if path.noticed[part].all():
                line = densified(path.points[part] + 2.0 * pixel * path.normals[part], 0.5 * pixel)
                picture.splat(line, LOUD, 2.4, 3.0 * pixel)
    return picture


def _draw(axes: Any, picture: Picture, features: Sequence[Feature]) -> None:
    """The pixels with the features' names and a scale bar."""
    pixels = picture.reduced(SUPERSAMPLING)
    axes.imshow(np.clip(pixels, 0.0, 1.0), interpolation="none")
    for feature in features:
        reference = feature.axis[len(feature.axis) // 2] if feature.anchor is None else feature.anchor.position
        # A wide bump hides its own foot: the label points at what stands out.
        crest = reference + max(feature.height.median, 0.0) * feature.normals[len(feature.axis) // 2]
        place, depth = picture.camera.project(crest[None, :])
        column, row = np.rint(place[0]).astype(int)
        hidden = not (0 <= row < picture.depth.shape[0] and 0 <= column < picture.depth.shape[1])
        if hidden or depth[0] > 1.02 * picture.depth[row, column]:
            continue
        axes.annotate(
            f"{feature.id}  {length_text(feature.height.median)}",
            place[0] / SUPERSAMPLING,
            xytext=(22, 44),
            textcoords="offset points",
            fontsize=8.5,
            color=INK,
            arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.6},
            bbox={"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )
    draw_scale_bar(axes, picture.camera)


def draw_scale_bar(axes: Any, camera: Camera) -> None:
    """A round length at the distance of the camera's target."""
    pixel = SUPERSAMPLING * pixel_size(camera)
    height, width = camera.height / SUPERSAMPLING, camera.width / SUPERSAMPLING
    wish = 0.16 * width * pixel
    power = 10.0 ** np.floor(np.log10(wish))
    length = float(max(step for step in (1.0, 2.0, 5.0) if step * power <= wish) * power)
    left, row = 0.03 * width, 0.965 * height
    axes.plot([left, left + length / pixel], [row, row], color=INK, linewidth=2.0, solid_capstyle="butt")
    axes.text(left, row - 0.012 * height, length_text(length), color=INK, fontsize=8.5, va="bottom")
