"""The paper's figures 1, 2, 3 and 5, and figure 2 of a mesh, drawn from this project's public functions alone."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from explore3d.pictures import BAND, ESTIMATED, FAINT, INK, MUTED, TRACED, TRUTH, new_figure, png, styled
from mapping import FloatArray, Trace
from mapping.detection import detect
from mapping.estimate.envelope import envelope_heights, estimate_surface
from mapping.estimate.sweeps import BRIDGED, smooth
from mapping.geometry.contact import BallContact, ParallelSurface, interference_points, parallel_surface
from mapping.geometry.mesh import write_whole
from mapping.geometry.templates import BumpOfRevolution
from mapping.instrument import Noise

# The paper's bump and tip (figure 3), in units of the bump's height; variance 0.01 is that of its section 4.1.
PAPER_BUMP, FIGURE_TIP_RADIUS = BumpOfRevolution(15.0), 1.0
SIGMA = 0.1
SECTION_SAMPLES = 6000
EXTENT = 2.6
# The mesh of figure 2 reaches as far as the ball does beyond the caustics; the ball slides over so many diameters of it
MESH_RINGS, MESH_SECTORS, DIAMETERS = 150, 120, 12
# On a mesh the ball touches twice at every concave edge too; there the contact leaps by a facet, at most 0.03 radii
WIDEST_FACET = 0.1


def write_figures(out: Path) -> list[Path]:
    """Write figures 1, 2, 3 and 5 of the paper as PNG files into a folder, which is made if absent.

    Figure 2 comes twice: from the closed forms, and from a mesh, as it can be had for any body.

    Returns:
        The files, in the order of the paper.

    Raises:
        OSError: the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    figures = {
        "figure1_traced_and_estimated.png": traced_and_estimated,
        "figure2_parallel_surface.png": folded_section,
        "figure2_of_a_mesh.png": folded_mesh,
        "figure3_curvature_features.png": curvature_features,
        "figure5_noise.png": noisy_trace,
    }
    written = []
    for name, draw in figures.items():
        with styled():
            written.append(write_whole(out / name, png(draw())))
    return written


@cache
def section_trace(samples: int = SECTION_SAMPLES) -> Trace:
    """The ball's path over a section through the bump's axis, by exact contact with its mesh."""
    mesh = PAPER_BUMP.mesh(EXTENT + 2 * FIGURE_TIP_RADIUS, rings=1200, sectors=16)
    x = np.linspace(-EXTENT, EXTENT, samples)
    above = np.column_stack([x, np.zeros(samples), np.full(samples, 4 * FIGURE_TIP_RADIUS)])
    centers = BallContact(mesh, FIGURE_TIP_RADIUS).first_contact(above, np.array([0.0, 0.0, -1.0])).centers
    return Trace.from_profile(centers[:, 0], centers[:, 2], FIGURE_TIP_RADIUS)


def traced_and_estimated() -> Any:
    """Figure 1: the tip's centre runs along the traced surface; the estimate bridges what the tip cannot reach."""
    trace = section_trace()
    estimate = estimate_surface(trace)
    bridged = estimate.labels == BRIDGED
    points = np.where(bridged[:, None], np.nan, estimate.points)
    resting = np.where(bridged[:, None], estimate.points, np.nan)
    figure = new_figure(7.2, 5.0)
    axes = figure.subplots()
    _body(axes)
    _ball(axes, _meeting(), MUTED, "fingertip of radius r, at rest")
    axes.plot(trace.centers[:, 0], trace.centers[:, 2], color=TRACED, lw=2.0, label="traced surface (tip centre)")
    axes.plot(points[:, 0], points[:, 2], color=TRUTH, lw=2.4, label="estimated surface: touched")
    axes.plot(resting[:, 0], resting[:, 2], color=ESTIMATED, lw=2.4, label="estimated surface: bridged")
    axes.set_title("Figure 1.  A round fingertip traces a surface finer than itself")
    _frame(axes, (-2.6, 2.6), (-0.15, 2.75))
    figure.legend(loc="outside lower center", ncols=3, handlelength=1.6)
    return figure


def folded_section() -> Any:
    """Figure 2: the parallel surface folds at caustic points; at the interference point the ball touches twice."""
    u = np.linspace(-EXTENT, EXTENT, 4001)
    x, z = _parallel(u)
    caustics = np.column_stack(PAPER_BUMP.parallel(PAPER_BUMP.caustics(FIGURE_TIP_RADIUS), FIGURE_TIP_RADIUS))
    meeting = _meeting()
    trace = section_trace().centers
    figure = new_figure(7.2, 3.5)
    wide, close = figure.subplots(1, 2, width_ratios=(1.35, 1.0))
    for axes in (wide, close):
        _body(axes)
        axes.plot(x, z, color=MUTED, lw=1.2, ls=(0, (4, 2)), label="parallel surface (the paper's equation 4)")
        axes.plot(trace[:, 0], trace[:, 2], color=TRACED, lw=2.2, label="traced surface")
        for sign in (-1, 1):
            names = ("caustic point, 1 + r k = 0", "interference point") if sign > 0 else ("", "")
            axes.plot(sign * caustics[:, 0], caustics[:, 1], "D", color=ESTIMATED, ms=3.5, ls="", label=names[0])
            axes.plot(sign * meeting[0], meeting[1], "o", color=INK, ms=4.0, ls="", label=names[1])
    _ball(wide, meeting, FAINT)
    wide.set_title("Figure 2.  Parallel and traced surface")
    close.set_title("The fold that the tip cannot follow")
    _frame(wide, (-2.1, 2.1), (-0.15, 2.75))
    corners = np.vstack([caustics, meeting[None]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    pad = 0.35 * (high - low).max()
    _frame(close, (low[0] - pad, high[0] + pad), (low[1] - pad, high[1] + pad))
    for axes in (wide, close):
        axes.set_anchor("N")  # else their titles stand at different heights
    handles, labels = wide.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, handlelength=1.8)
    return figure


@cache
def mesh_fold() -> tuple[ParallelSurface, FloatArray]:
    """The parallel surface of the bump's mesh, and the centres (M, 3) where a ball that slides over it leaps."""
    mesh = PAPER_BUMP.mesh(EXTENT + FIGURE_TIP_RADIUS, MESH_RINGS, MESH_SECTORS)
    u = np.hypot(*mesh.vertices[:, :2].T)
    radial, axial = PAPER_BUMP.normal(u)
    away = mesh.vertices[:, :2] / np.maximum(u, np.finfo(np.float64).tiny)[:, None]
    normals = np.column_stack([away * radial[:, None], axial])
    folded = parallel_surface(mesh, FIGURE_TIP_RADIUS, normals, *PAPER_BUMP.curvatures(u))
    ball, down, found = BallContact(mesh, FIGURE_TIP_RADIUS), np.array([0.0, 0.0, -1.0]), []
    for turn in np.pi * (np.arange(DIAMETERS) + 0.25) / DIAMETERS:
        along = np.array([np.cos(turn), np.sin(turn), 0.0])
        path = np.outer([-2.0, 2.0], along) - 4 * FIGURE_TIP_RADIUS * down
        met = interference_points(ball, path, down, 0.2 * FIGURE_TIP_RADIUS).centers
        before, after = (ball.press(met + step * along - down, down).points for step in (-1e-3, 1e-3))
        found.append(met[np.linalg.norm(after - before, axis=1) > WIDEST_FACET * FIGURE_TIP_RADIUS])
    return folded, np.concatenate(found)


def folded_mesh() -> Any:
    """Figure 2 from a mesh alone: where its parallel surface folds, and where a sliding ball touches twice."""
    folded, met = mesh_fold()
    rings = np.concatenate(
        [PAPER_BUMP.parallel(PAPER_BUMP.caustics(FIGURE_TIP_RADIUS), FIGURE_TIP_RADIUS)[0], _meeting()[:1]]
    )
    figure = new_figure(7.2, 4.3)
    above, section = figure.subplots(1, 2)
    for axes, across in ((above, False), (section, True)):

        def place(points: FloatArray, across: bool = across) -> tuple[FloatArray, FloatArray]:
            return (np.hypot(*points[:, :2].T), points[:, 2]) if across else (points[:, 0], points[:, 1])

        for reached, color, name in ((True, TRACED, "parallel surface"), (False, ESTIMATED, "turned inside out")):
            there = folded.surface.vertices[folded.reachable == reached]
            axes.plot(*place(there), ".", color=color, ms=1.6 if reached else 2.2, mew=0, alpha=0.55, label=name)
        axes.plot(*place(folded.caustics), ".", color=TRUTH, ms=3.0, mew=0, label="caustic points of the mesh")
        axes.plot(*place(met), "o", color=INK, ms=4.0, label="interference points of a sliding ball")
    angle = np.linspace(0, 2 * np.pi, 361)
    for ring in rings:
        above.plot(ring * np.cos(angle), ring * np.sin(angle), color=MUTED, lw=0.7, ls=(0, (3, 3)), zorder=0.5)
    section.plot(*_parallel(np.linspace(0, EXTENT, 2001)), color=MUTED, lw=0.7, zorder=0.5, label="closed forms")
    above.set_title("Figure 2 from a mesh, seen from above")
    section.set_title("The same in a section through the axis")
    reach = 1.12 * float(rings.max())
    _frame(above, (-reach, reach), (-reach, reach))
    above.set_ylabel("y")
    heights = folded.caustics[:, 2]
    _frame(section, (0.9 * float(rings.min()), reach), (float(heights.min()) - 0.06, float(heights.max()) + 0.06))
    section.set_xlabel("distance from the axis")
    section.set_aspect("auto")
    section.set_box_aspect(1)
    figure.legend(*section.get_legend_handles_labels(), loc="outside lower center", ncols=3, markerscale=2.0)
    return figure


def curvature_features() -> Any:
    """Figure 3: along the bump the curvature leaves the band of +-1/r three times: concave, convex, concave."""
    from matplotlib.ticker import NullLocator

    u = np.linspace(-1.5, 1.5, 3001)
    k = PAPER_BUMP.curvatures(np.abs(u))[0] * FIGURE_TIP_RADIUS
    figure = new_figure(7.2, 5.0)
    over, under = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.2))
    over.fill_between(u, PAPER_BUMP.height(u), -0.1, color=FAINT, lw=0)
    over.plot(u, PAPER_BUMP.height(u), color=INK)
    under.axhspan(-1, 1, color=FAINT, lw=0)
    under.plot(u, k, color=INK)
    for sign, color, name in ((1, ESTIMATED, "convex, k > 1/r"), (-1, TRACED, "concave, k < -1/r")):
        there = sign * k > 1
        over.plot(u, np.where(there, PAPER_BUMP.height(u), np.nan), color=color, lw=4)
        under.plot(u, np.where(there, k, np.nan), color=color, lw=3, label=f"curvature feature: {name}")
    over.set_title("Figure 3.  A bump is the sequence {-}{+}{-} of curvature features (a = 15, r = 1)")
    over.set_ylabel("height")
    over.set_ylim(-0.1, 1.25)
    under.set_yscale("asinh", linear_width=1.5)  # smooth, unlike symlog, whose corner looks like a feature
    under.set_yticks([-2, -1, 0, 1, 2, 10, 30], ["−2", "−1", "0", "1", "2", "10", "30"])
    under.yaxis.set_minor_locator(NullLocator())
    under.set_ylabel("curvature along u, times r")
    under.set_xlabel("u, in heights of the bump")
    under.legend(loc="upper right")
    return figure


def noisy_trace() -> Any:
    """Figure 5: the trace under the paper's noise, what ball operators make of it, and what smoothing saves."""
    exact, noise = section_trace(), Noise(SIGMA)
    x = exact.centers[:, 0]
    shaken = exact.centers[:, 2] + SIGMA * np.random.default_rng(1999).standard_normal(len(x))
    noisy = Trace.from_profile(x, shaken, FIGURE_TIP_RADIUS)
    smoothed, estimate = smooth(noisy, noise), estimate_surface(noisy, noise=noise)
    figure = new_figure(7.2, 6.8)
    over, under = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1.0))
    _body(over)
    over.plot(x[::4], shaken[::4], ".", color=TRACED, ms=1.2, alpha=0.5, label="trace with noise, variance 0.01")
    over.plot(*smoothed.trace.centers[:, [0, 2]].T, color=INK, label="smoothed trace")
    raw = envelope_heights(x, shaken, FIGURE_TIP_RADIUS)[0]
    over.plot(x, raw, color=MUTED, lw=1.0, ls=(0, (3, 1.5)), label="ball envelope of the raw trace")
    bridged = (estimate.labels == BRIDGED)[:, None]
    for mask, color, name in ((bridged, TRUTH, "touched"), (~bridged, ESTIMATED, "bridged")):
        points = np.where(mask, np.nan, estimate.points)
        over.plot(points[:, 0], points[:, 2], color=color, lw=2.2, label=f"estimated surface: {name}")
    over.set_title("Figure 5.  The trace under noise: smoothed at the noise's own scale, without bias")
    _frame(over, (-EXTENT, EXTENT), (-0.75, 2.5))
    over.set_aspect("auto")
    over.set_xlabel("")
    place = smoothed.trace.centers[:, 0]
    under.axhspan(0.5, 1.0, color=BAND, lw=0, label="convex: 1/(2r) < k_t < 1/r")
    under.plot(place, smoothed.curvature * FIGURE_TIP_RADIUS, color=INK, label="k_t of the smoothed trace")
    for k, crossing in enumerate(detect(noisy, noise=noise, largest=1.5 * FIGURE_TIP_RADIUS).crossings):
        name = f"bump found: {crossing.height:.2f} high"
        under.axvline(crossing.point[0], color=ESTIMATED, lw=1.4, label=name if k == 0 else "")
    under.set_xlabel("x, in heights of the bump")
    under.set_ylabel("k_t times r")
    under.set_ylim(-3.2, 2.2)
    figure.legend(loc="outside lower center", ncols=3, markerscale=6, handlelength=1.6)
    return figure


def _parallel(u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The parallel surface's section through the axis, on both sides of it."""
    radial, height = PAPER_BUMP.parallel(np.abs(u), FIGURE_TIP_RADIUS)
    return np.sign(u) * radial, height


def _meeting() -> FloatArray:
    """Centre (x, z) of the ball at the interference point to the right of the bump."""
    flank, _ = PAPER_BUMP.interference(FIGURE_TIP_RADIUS) or (0.0, 0.0)
    return np.array(PAPER_BUMP.parallel(flank, FIGURE_TIP_RADIUS))


def _body(axes: Any) -> None:
    u = np.linspace(-EXTENT - FIGURE_TIP_RADIUS, EXTENT + FIGURE_TIP_RADIUS, 4001)
    axes.fill_between(u, PAPER_BUMP.height(u), -1.0, color=FAINT, lw=0)
    axes.plot(u, PAPER_BUMP.height(u), color=INK, lw=1.0, label="body")


def _ball(axes: Any, center: FloatArray, color: str, label: str = "") -> None:
    angle = np.linspace(0, 2 * np.pi, 241)
    x, z = center[0] + FIGURE_TIP_RADIUS * np.cos(angle), center[1] + FIGURE_TIP_RADIUS * np.sin(angle)
    axes.plot(x, z, color=color, lw=1.2, zorder=1.5, label=label)
    axes.plot(*center, "+", color=color, ms=7, zorder=1.6)


def _frame(axes: Any, across: tuple[float, float], up: tuple[float, float]) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(*across)
    axes.set_ylim(*up)
    axes.set_xlabel("x, in heights of the bump")
    axes.set_ylabel("z")
