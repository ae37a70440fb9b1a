"""Interactive views for the report: the model in 3D, or a profile, drawn by the page's own small scripts."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from explore3d.pictures import SweepPath, profile_line, thinned, view_directions
from explore3d.report.markup import Html, data_script, element, script, text
from mapping import Feature, FloatArray, Surface, Trace, length_unit
from mapping.base import Base, LaidTrace
from mapping.geometry.mesh import middle
from mapping.inference.kinds import kind_of, sizes_of
from mapping.model import drawn_at_least, feature_mesh

# More than this makes pages slow without showing more.
MOST_FACES = 60_000
# A profile of more samples is drawn by the lowest and highest of this number of stretches: 0.3 MB of the page.
PROFILE_STRETCHES = 20_000
# Features are drawn at least this share of the base's size wide.
LEAST_FEATURE_SHARE = 0.004
# Sweeps are drawn this share of the base's size above it
LIFT_SHARE = 1e-3
VIEW_BASE_COLOUR = (0.9, 0.915, 0.935)
SWEEP_COLOUR = (0.42, 0.52, 0.62)
NOTICED_COLOUR = (0.93, 0.55, 0.13)
SWEEP_WIDTH, NOTICED_WIDTH = 1.2, 2.4  # px
FEEL_BOX = Html('<label><input type="checkbox" class="feel"> feel with the pointer (sound, gamepad)</label>')
LAYERS = {"base": "base", "sweeps": "sweeps", "noticed": "what a sweep noticed", "features": "features"}
# Shares of a box that the places of a view are rounded to: 3 um of 0.2 m
STEPS = 65535


def object_view(
    base: Surface, features: Sequence[Feature], sweeps: Sequence[SweepPath], tip_radius: float | None = None
) -> Html:
    """The base, the sweeps and the features, to be turned by hand; a click on a feature tells its record.

    With a tip radius (m) the pointer feels the features as that fingertip does.
    """
    shown = [_mesh(lighter(base), "base", VIEW_BASE_COLOUR)]
    for feature in features:
        shape = feature_mesh(drawn_at_least(feature, LEAST_FEATURE_SHARE * base.size))
        colour = tuple(round(float(each), 3) for each in kind_of(feature).colour[:3])
        outward = feature.normals.mean(axis=0).tolist()
        record = {"id": feature.id, "text": hover_text(feature), "outward": outward}
        shown.append(_mesh(shape, "features", colour) | record)
    points = [path.points + LIFT_SHARE * base.size * path.normals for path in sweeps]
    lines = [_lines(points, "sweeps", SWEEP_COLOUR, SWEEP_WIDTH)]
    noticed = [part[first:last] for part, path in zip(points, sweeps, strict=True) for first, last in _noticed(path)]
    lines.append(_lines(noticed, "noticed", NOTICED_COLOUR, NOTICED_WIDTH))
    lines = [each for each in lines if each["starts"]]
    low, high = _box([base.vertices, *points])
    factor, unit = length_unit(0.3 * base.size)
    data = {
        "box": [low.tolist(), high.tolist()],
        "unit": unit,
        "factor": 1.0 / factor,
        "eye": _eye(sweeps, features, base).tolist(),
        "meshes": shown,
        "lines": lines,
        "touch": [] if tip_radius is None else [_touch(each, tip_radius) for each in features],
    }
    present = {each["layer"] for each in (*shown, *lines)}
    boxes = [_layer(name, words) for name, words in LAYERS.items() if name in present]
    scripts = ["viewer.js"]
    if data["touch"]:
        boxes.append(FEEL_BOX)
        scripts.append("touch.js")
    keys = "Drag to turn, shift and drag to move, scroll to zoom, click a feature. Keys: arrows, + −, n and p for the "
    return _view(
        boxes,
        "The object in 3D",
        keys + "next and previous feature, u for another unit, 0 for the whole.",
        data,
        scripts,
    )


def profile_view(trace: Trace, base: Base, features: Sequence[Feature]) -> Html:
    """The height over the base along a profile, to be zoomed by hand, with the features marked."""
    height = LaidTrace.of(trace, base).feet().height
    origin, heading = profile_line(trace)
    place = (trace.centers - origin) @ heading
    order = np.argsort(place, kind="stable")
    x_factor, x_unit = length_unit(float(np.abs(place).max()))
    factor, unit = length_unit(float(np.abs(height).max()))
    x, y = thinned(place[order] / x_factor, height[order] / factor, PROFILE_STRETCHES)
    data = {
        "x": _packed(x, np.float32),
        "y": _packed(y, np.float32),
        "x_name": f"place along the profile ({x_unit})",
        "y_name": f"height over the base ({unit})",
        "features": [
            {
                "id": each.id,
                "x": float((middle(each.axis)[0] - origin) @ heading) / x_factor,
                "y": float(each.height.median) / factor,
                "finer": each.curvature_feature,
                "text": hover_text(each),
            }
            for each in features
        ],
    }
    keys = (
        "Scroll to zoom, drag to move, click a feature. Keys: arrows, + −, n and p for the next and previous feature, "
    )
    return _view(
        [], "The height along the profile", keys + "u for another unit, 0 for the whole.", data, ["profile.js"]
    )


def hover_text(feature: Feature) -> list[str]:
    """What a feature's label says, in lines: name, sizes with intervals, evidence."""
    lines = [feature.id]
    for name in ("height", "width", "length"):
        median, span = getattr(feature, name).text()
        if getattr(feature, name).median:
            lines.append(f"{name} {median}" + (f" ({span})" if span else ""))
    finer = "finer than the tip" if feature.curvature_feature else "gentler than the tip"
    return [*lines, f"signal to noise {feature.evidence.snr:.0f}, crossings {feature.evidence.crossings}", finer]


def _view(boxes: Sequence[Html], label: str, keys: str, data: dict[str, Any], codes: Sequence[str]) -> Html:
    """A canvas with its buttons, its data, and the scripts that draw them."""
    tools = element("div", *boxes, element("button", "show all", type="button", class_="reset"), class_="tools")
    canvas = element("canvas", tabindex="0", role="application", aria_label=f"{label}. {keys}")
    flat = " flat" if "profile.js" in codes else ""
    strip = [element("canvas", class_="strip", hidden="hidden")] if "touch.js" in codes else []
    stage = element(
        "div",
        canvas,
        element("pre", class_="label", hidden="hidden", aria_live="polite"),
        *([] if flat else [element("div", class_="scale")]),
        *strip,
        class_="stage",
    )
    whole = element("div", tools, stage, id="view", class_=f"view{flat}")
    programs = [Path(__file__).with_name(code).read_text(encoding="utf-8") for code in codes]
    # the scripts are wrapped, so that their names are nobody else's
    wrapped = "".join(script("{\n" + program + "}\n") for program in programs)
    return Html(whole + element("p", keys, class_="hint") + data_script("view-data", data) + wrapped)


def _touch(feature: Feature, tip_radius: float) -> dict[str, Any]:
    """What the pointer feels of a feature: its axis, its height and the half-width of what it does to the trace."""
    half = sizes_of(feature, tip_radius).half_width
    return {"axis": feature.axis.ravel().tolist(), "height": float(feature.height.median), "half": half}


def _layer(name: str, words: str) -> Html:
    box = Html(f'<input type="checkbox" checked data-layer="{name}"> ')
    return element("label", Html(box + text(words)))


def _packed(values: ArrayLike, kind: type[np.generic]) -> str:
    """Numbers as they lie in memory, little-endian, in base64."""
    array = np.ascontiguousarray(values, dtype=np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(array.tobytes()).decode("ascii")


def _places(points: FloatArray) -> dict[str, Any]:
    """Points (N, 3) as shares of their own box, in 16 bits."""
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    shares = np.rint((points - low) / np.where(span > 0, span, 1.0) * STEPS)
    return {"low": low.tolist(), "span": span.tolist(), "points": _packed(shares, np.uint16)}


def _mesh(surface: Surface, layer: str, colour: Sequence[float]) -> dict[str, Any]:
    record: dict[str, Any] = {"layer": layer, "colour": list(colour), "faces": _packed(surface.faces, np.uint32)}
    return record | _places(surface.vertices)


def _lines(paths: Sequence[FloatArray], layer: str, colour: Sequence[float], width: float) -> dict[str, Any]:
    paths = [each for each in paths if len(each) > 1]
    starts = np.cumsum([0, *(len(each) for each in paths)])[:-1].tolist()
    record: dict[str, Any] = {"layer": layer, "colour": list(colour), "width": width, "starts": starts}
    return record | (_places(np.concatenate(paths)) if paths else {})


def _noticed(path: SweepPath) -> list[tuple[int, int]]:
    """(first, past last) point of each stretch of a sweep that noticed something."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], path.noticed, [False]]).astype(np.int8)))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _box(parts: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest (3,) of all that is drawn."""
    return np.min([each.min(axis=0) for each in parts], axis=0), np.max([each.max(axis=0) for each in parts], axis=0)


def lighter(surface: Surface, most: int = MOST_FACES) -> Surface:
    """The surface with at most so many faces: vertices that share a cell of a grid become one, at their mean.

    Reference: Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.
    """
    simpler, cell = surface, float(np.sqrt(2.0 * surface.face_areas.sum() / most))
    while len(simpler.faces) > most:
        cells = np.floor((surface.vertices - surface.vertices.min(axis=0)) / cell).astype(np.int64)
        _, owner, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        owner = owner.ravel()
        means = np.stack([np.bincount(owner, surface.vertices[:, i]) / count for i in range(3)], axis=1)
        faces = owner[surface.faces]
        kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        simpler, cell = Surface(means, faces[kept]), 1.1 * cell
    return simpler


def _eye(sweeps: Sequence[SweepPath], features: Sequence[Feature], base: Surface) -> FloatArray:
    """(3,) direction from the object towards the camera: that of the first still picture."""
    normals = np.concatenate([np.zeros((0, 3)), *(path.normals for path in sweeps)])
    direction = view_directions(normals, features, base)[0]
    return np.asarray(direction / np.linalg.norm(direction))
