"""Interactive views for the report: the model in 3D, or a profile, drawn by plotly inside the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from explore3d.pictures import ESTIMATED, INK, TRACED, SweepPath, profile_line, view_directions
from explore3d.report.markup import Html, element
from mapping import Feature, FloatArray, Surface, Trace, length_unit
from mapping.base import Base
from mapping.geometry.mesh import open3d
from mapping.inference.kinds import kind_of
from mapping.model import drawn_at_least, feature_mesh

# More than this makes pages slow without showing more.
MOST_FACES = 60_000
# Features are drawn at least this share of the base's size wide.
LEAST_FEATURE_SHARE = 0.004
VIEW = "view"
# Diagonal of what is drawn, in units of the scene; the camera stands 1.7 of them off.
SCENE_DIAGONAL = 1.4


def plotly_script() -> Html:
    """The library itself, for the page's head: nothing is fetched when the page opens."""
    from plotly.offline import get_plotlyjs

    return Html(f"<script>{get_plotlyjs()}</script>")


def object_view(base: Surface, features: Sequence[Feature], sweeps: Sequence[SweepPath]) -> Html:
    """The base, the sweeps and the features, to be turned by hand; hover texts tell each feature's record."""
    import plotly.graph_objects as plot

    factor, unit = length_unit(0.3 * base.size)
    parts: list[Any] = [_mesh(_lighter(base), factor, "base", "#f4f6f9", None, opacity=1.0)]
    lines = _lines(sweeps, 1e-3 * base.size) / factor
    parts.append(
        plot.Scatter3d(
            x=lines[:, 0],
            y=lines[:, 1],
            z=lines[:, 2],
            mode="lines",
            name="sweeps",
            hoverinfo="skip",
            line={"color": "#486581", "width": 3},
        )
    )
    for feature in features:
        colour = "rgb" + str(tuple(round(255 * each) for each in kind_of(feature).colour[:3]))
        shape = feature_mesh(drawn_at_least(feature, LEAST_FEATURE_SHARE * base.size))
        parts.append(_mesh(shape, factor, feature.id, colour, hover_text(feature), opacity=1.0))
    axes = {"showbackground": False, "gridcolor": "#e4e7eb", "zeroline": False}
    drawing = plot.Figure(parts)
    low, high = _box(parts)
    ratio = SCENE_DIAGONAL * (high - low) / np.linalg.norm(high - low)
    scene: dict[str, Any] = {"aspectmode": "manual", "aspectratio": dict(zip("xyz", map(float, ratio), strict=True))}
    for axis, *ends in zip("xyz", map(float, low), map(float, high), strict=True):
        scene[f"{axis}axis"] = axes | {"title": f"{axis} ({unit})", "range": ends}
    drawing.update_layout(
        scene=scene,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        legend={"x": 0.01, "y": 0.99, "bgcolor": "rgba(255,255,255,0.8)"},
        font={"family": "system-ui, sans-serif", "color": INK},
    )
    drawing.update_scenes(camera=_camera(sweeps))
    return _inlined(drawing, "view")


def profile_view(trace: Trace, base: Base, features: Sequence[Feature]) -> Html:
    """The height over the base along a profile, to be zoomed by hand, with the features marked."""
    import plotly.graph_objects as plot

    height = base.foot(trace.centers, trace.tip_radius).height
    origin, heading = profile_line(trace)
    x = (trace.centers - origin) @ heading
    x_factor, x_unit = length_unit(float(np.abs(x).max()))
    factor, unit = length_unit(float(np.abs(height).max()))
    marks = np.array([(each.axis[0] - origin) @ heading for each in features]) / x_factor
    drawing = plot.Figure(
        [
            plot.Scatter(
                x=x / x_factor, y=height / factor, mode="lines", name="height over the base",
                line={"color": TRACED, "width": 1}, hoverinfo="skip",
            ),
            plot.Scatter(
                x=marks, y=[each.height.median / factor for each in features], mode="markers", name="features",
                marker={"color": ESTIMATED, "size": 8, "symbol": "triangle-down"},
                text=[hover_text(each) for each in features], hovertemplate="%{text}<extra></extra>",
            ),
        ]
    )  # fmt: skip
    drawing.update_layout(
        template="simple_white",
        xaxis_title=f"place along the profile ({x_unit})",
        yaxis_title=f"height over the base ({unit})",
        margin={"l": 60, "r": 20, "t": 10, "b": 50},
        legend={"orientation": "h", "x": 0.0, "y": 1.02, "yanchor": "bottom"},
        font={"family": "system-ui, sans-serif", "color": INK},
    )
    return _inlined(drawing, "view flat")


def hover_text(feature: Feature) -> str:
    """What a feature's label says: name, sizes with intervals, evidence."""
    lines = [f"<b>{feature.id}</b>"]
    for name in ("height", "width", "length"):
        median, span = getattr(feature, name).text()
        if getattr(feature, name).median:
            lines.append(f"{name} {median}" + (f" ({span})" if span else ""))
    finer = "finer than the tip" if feature.curvature_feature else "gentler than the tip"
    lines += [f"signal to noise {feature.evidence.snr:.0f}, crossings {feature.evidence.crossings}", finer]
    return "<br>".join(lines)


def _inlined(drawing: Any, kind: str) -> Html:
    written = drawing.to_html(
        full_html=False, include_plotlyjs=False, div_id=VIEW, default_width="100%", default_height="100%",
        config={"displaylogo": False, "responsive": True, "scrollZoom": kind == "view"},
    )  # fmt: skip
    return element("div", Html(written), class_=kind)


def _mesh(surface: Surface, factor: float, name: str, colour: str, hover: str | None, opacity: float) -> Any:
    import plotly.graph_objects as plot

    points = (surface.vertices / factor).astype(np.float32)
    i, j, k = surface.faces.T.astype(np.int32)
    return plot.Mesh3d(
        x=points[:, 0], y=points[:, 1], z=points[:, 2], i=i, j=j, k=k, name=name, color=colour, opacity=opacity,
        hoverinfo="skip" if hover is None else "text", text=hover, showlegend=hover is not None, flatshading=True,
        lighting={"ambient": 0.85, "diffuse": 0.35, "specular": 0.05, "roughness": 0.9},
    )  # fmt: skip


def _box(parts: Sequence[Any]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest (3,) of all that is drawn, and a little air: axes of one scale over it, however flat it is."""
    points = np.concatenate([np.column_stack([part[axis] for axis in "xyz"]) for part in parts])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    air = 0.02 * float((high - low).max())
    return low - air, high + air


def _lines(sweeps: Sequence[SweepPath], lift: float) -> FloatArray:
    """(M, 3) points just above the base, NaN between sweeps."""
    gap = np.full((1, 3), np.nan)
    pieces = [np.vstack([path.points + lift * path.normals, gap]) for path in sweeps]
    return np.concatenate([np.zeros((0, 3)), *pieces])


def _lighter(surface: Surface) -> Surface:
    """The surface with at most MOST_FACES faces."""
    if len(surface.faces) <= MOST_FACES:
        return surface

    o3d = open3d()
    origin = surface.bounds.mean(axis=0)
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(surface.vertices - origin), o3d.utility.Vector3iVector(surface.faces)
    )
    simpler = mesh.simplify_quadric_decimation(MOST_FACES)
    return Surface(np.asarray(simpler.vertices) + origin, np.asarray(simpler.triangles))


def _camera(sweeps: Sequence[SweepPath]) -> dict[str, Any]:
    direction = view_directions(np.concatenate([np.zeros((0, 3)), *(path.normals for path in sweeps)]), ())[0]
    eye = 1.7 * direction / np.linalg.norm(direction)
    return {"eye": dict(zip("xyz", map(float, eye), strict=True))}
