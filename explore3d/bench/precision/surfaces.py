"""Error against time of the geometry: traced surface, estimated surface, curvature."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from explore3d.bench import bump_mesh, by_opencamlib
from explore3d.bench.precision.work_precision import LeftOutMethod, Point, Stage, timed
from explore3d.bench.scenes import DIAMETER, TIP_RADIUS, sweeps, wire
from mapping import FloatArray, Surface, Trace
from mapping.estimate.envelope import Estimate, estimate_surface
from mapping.estimate.sweeps import EXTRAPOLATED
from mapping.geometry.contact import BallContact
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.mesh import open3d
from mapping.geometry.templates import BumpOfRevolution
from mapping.instrument import Noise

Result = list[Point | LeftOutMethod]

STEEPNESS, BUMP_BALL_RADIUS = 15.0, 0.5
DOWN = np.array([0.0, 0.0, -1.0])
BUMP_PLACES = np.linspace(0.0, 0.45, 400)


def dilated(places: FloatArray) -> FloatArray:
    """Height of the ball's centre over the smooth bump: the largest of h(u) + sqrt(r^2 - (x - u)^2), by refinement."""
    bump, low, high = BumpOfRevolution(STEEPNESS), places - BUMP_BALL_RADIUS, places + BUMP_BALL_RADIUS
    for _ in range(14):
        u = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 201)
        room = np.clip(BUMP_BALL_RADIUS**2 - (places[:, None] - u) ** 2, 0.0, None)
        height = bump.height(u) + np.sqrt(room)
        best = height.argmax(axis=1)
        middle, reach = u[np.arange(len(places)), best], (high - low) / 100
        low, high = middle - reach, middle + reach
    return np.asarray(height.max(axis=1))


def paralleled(places: FloatArray) -> FloatArray:
    """The same from the parallel curve: its highest point over each place, by bisection.

    Reference: the paper's equation 11; theory equation 2.6.
    """
    bump = BumpOfRevolution(STEEPNESS)
    u = np.linspace(-0.2, 1.2, 28_001)
    place = np.sign(u) * bump.parallel(np.abs(u), BUMP_BALL_RADIUS)[0]
    best = np.full(len(places), -np.inf)
    for k, x in enumerate(places):
        for i in np.flatnonzero((place[:-1] <= x) != (place[1:] <= x)):
            low, high = u[i], u[i + 1]
            rising = place[i + 1] > place[i]
            for _ in range(60):
                middle = 0.5 * (low + high)
                there = np.sign(middle) * bump.parallel(abs(middle), BUMP_BALL_RADIUS)[0]
                low, high = (middle, high) if (there <= x) == rising else (low, middle)
            best[k] = max(best[k], float(bump.parallel(abs(low), BUMP_BALL_RADIUS)[1]))
    return best


def traced(quick: bool, peers: bool) -> Result:
    """Heights of the ball's centre over ever finer meshes of the paper's bump."""
    true = dilated(BUMP_PLACES)
    doubt = float(np.abs(true - paralleled(BUMP_PLACES)).max())
    out: Result = [LeftOutMethod("traced surface", "reference", f"its two ways of computing agree to {doubt:.0e}")]
    start = np.column_stack([BUMP_PLACES, np.full(len(BUMP_PLACES), 0.003), np.full(len(BUMP_PLACES), 4.0)])
    for size in (512, 2048, 8192, 32_768) if quick else (512, 2048, 8192, 32_768, 131_072, 524_288):
        mesh = bump_mesh(size)
        for method, trace in TRACERS.items():
            if method == "every vertex (brute force)" and size > 40_000:
                continue
            seconds, repeats, heights = timed(partial(trace, mesh, start))
            error = float(np.sqrt(np.mean((heights - true) ** 2)))
            out.append(Point("traced surface", method, f"{len(mesh.faces)} triangles", seconds, error, repeats))
    missing = "not installed: pip install explore3d[peers]" if not importlib.util.find_spec("opencamlib") else ""
    if peers and not missing:
        for size in (512, 2048, 8192):
            out.append(_opencamlib(size, start, true))
    else:
        out.append(
            LeftOutMethod("traced surface", "OpenCAMLib BallCutter", missing or "peers were not asked for: --peers")
        )
    out.append(LeftOutMethod("traced surface", "every vertex (brute force), above 40 000 triangles", "minutes a point"))
    return out


def _opencamlib(size: int, start: FloatArray, true: FloatArray) -> Point:
    mesh = bump_mesh(size)
    found = by_opencamlib(mesh, BUMP_BALL_RADIUS, start)
    error = float(np.sqrt(np.mean((found.heights - true[found.which]) ** 2)))
    return Point("traced surface", "OpenCAMLib BallCutter", f"{len(mesh.faces)} triangles", found.seconds, error)


def _by_tree(mesh: Surface, start: FloatArray) -> FloatArray:
    return np.asarray(BallContact(mesh, BUMP_BALL_RADIUS).first_contact(start, DOWN).centers[:, 2])


def _by_vertices(mesh: Surface, start: FloatArray) -> FloatArray:
    heights = np.empty(len(start))
    for k, (x, y, _) in enumerate(start):
        room = BUMP_BALL_RADIUS**2 - (mesh.vertices[:, 0] - x) ** 2 - (mesh.vertices[:, 1] - y) ** 2
        near = room > 0
        heights[k] = (mesh.vertices[near, 2] + np.sqrt(room[near])).max()
    return heights


def _by_displaced_mesh(mesh: Surface, start: FloatArray) -> FloatArray:
    o3d: Any = open3d()
    u = np.hypot(*mesh.vertices[:, :2].T)
    radial, axial = BumpOfRevolution(STEEPNESS).normal(u)
    out = radial / np.where(u > 0, u, 1.0)
    normals = np.column_stack([mesh.vertices[:, 0] * out, mesh.vertices[:, 1] * out, axial])
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    displaced = (mesh.vertices + BUMP_BALL_RADIUS * normals).astype(np.float32)
    scene.add_triangles(o3d.core.Tensor(displaced), o3d.core.Tensor(mesh.faces.astype(np.uint32)))
    rays = np.hstack([start, np.tile(DOWN, (len(start), 1))]).astype(np.float32)
    return np.asarray(start[:, 2] - scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)["t_hit"].numpy())


TRACERS: dict[str, Callable[[Surface, FloatArray], FloatArray]] = {
    "exact ball on a tree of boxes (ours)": _by_tree,
    "every vertex (brute force)": _by_vertices,
    "displaced mesh, rays (Open3D)": _by_displaced_mesh,
}


TRACE_WHITE_NOISE = 20e-6  # noise of the trace whose body is estimated, m


def estimated(quick: bool, peers: bool) -> Result:
    """The body under a noisy trace of a wire on a plate; the wire and the plate themselves are the truth."""
    out: Result = []
    for spacing in (0.2e-3, 0.1e-3, 0.05e-3) if quick else (0.2e-3, 0.1e-3, 0.05e-3, 0.025e-3, 0.0125e-3, 6e-6):
        places = np.arange(-3e-3, 3.1e-3, 1e-3).tolist()
        bare = sweeps(wire(), places=places, spacing=spacing, half=8e-3, white=TRACE_WHITE_NOISE)
        trace = Trace(bare.t, bare.centers, bare.sweep, TIP_RADIUS, normals=_normals(bare.centers))
        ways: dict[str, Callable[[], Estimate]] = {
            "envelope, noise known (ours)": partial(
                estimate_surface, trace, noise=Noise(TRACE_WHITE_NOISE), spacing=0.0
            ),
            "envelope of the raw trace": partial(estimate_surface, trace, spacing=0.0),
            "recorded contact normals": partial(estimate_surface, trace, "contact", spacing=0.0),
            "normals of the raw trace (the paper's equation 12)": partial(
                estimate_surface, trace, "normals", spacing=0.0
            ),
        }
        for method, way in ways.items():
            seconds, repeats, found = timed(way)
            inside = found.points[found.labels != EXTRAPOLATED]
            name = f"a sample every {spacing * 1e6:g} um"
            out.append(Point("estimated surface", method, name, seconds, _off_body(inside), repeats))
    why = "reconstruction from tangent balls (gpytoolbox) and Poisson need packages beyond this project's"
    return [*out, LeftOutMethod("estimated surface", "Reach for the Spheres, Poisson", why)]


def _normals(centers: FloatArray) -> FloatArray:
    arm = np.column_stack([np.zeros(len(centers)), centers[:, 1], centers[:, 2] - 0.5 * DIAMETER])
    on_wire = centers[:, 2] > TIP_RADIUS
    normals = np.where(on_wire[:, None], arm, [0.0, 0.0, 1.0])
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _off_body(points: FloatArray) -> float:
    """Root mean square distance (m) from the wire and the plate, whichever is nearer."""
    to_wire = np.abs(np.hypot(points[:, 1], points[:, 2] - 0.5 * DIAMETER) - 0.5 * DIAMETER)
    return float(np.sqrt(np.mean(np.minimum(to_wire, np.abs(points[:, 2])) ** 2)))


def curvature(quick: bool, peers: bool) -> Result:
    """Principal curvatures of ever finer meshes of the paper's bump, without noise and with."""
    out: Result = []
    for size in (4000, 16_000) if quick else (4000, 16_000, 64_000, 256_000):
        clean = bump_mesh(size)
        ways: dict[str, Callable[[], Any]] = {"local jets (ours)": partial(principal_curvatures, clean)}
        for radius in (2, 5, 8):
            ways[f"libigl, {radius} rings"] = partial(principal_curvatures, clean, "libigl", radius=radius)
        for method, way in ways.items():
            seconds, repeats, found = timed(way, 1)
            error = _curvature_error(clean, found)
            out.append(Point("curvature", method, f"{len(clean.vertices)} vertices", seconds, error, repeats))
    found_peer = importlib.util.find_spec("pymeshlab") is not None
    if peers and found_peer:
        out.append(LeftOutMethod("curvature", "pymeshlab quadric", "its filter has no option for outward signs here"))
    else:
        why = "peers were not asked for: --peers" if found_peer else "not installed: pip install explore3d[peers]"
        out.append(LeftOutMethod("curvature", "pymeshlab quadric", why))
    return [*out, LeftOutMethod("curvature", "CGAL jets, APSS, Open3D", "no wheels, or no curvature")]


def _curvature_error(mesh: Surface, found: Any) -> float:
    """Median error of both curvatures in the interior, over the largest."""
    u = np.hypot(*mesh.vertices[:, :2].T)
    inside = (np.abs(mesh.vertices[:, :2]).max(axis=1) < 0.8) & found.valid
    radial, around = BumpOfRevolution(STEEPNESS).curvatures(u[inside])
    off = np.abs(found.k1[inside] - np.maximum(radial, around)) + np.abs(found.k2[inside] - np.minimum(radial, around))
    return float(np.median(off) / (2 * STEEPNESS))


SURFACE_STAGES = (
    Stage("traced surface", "root mean square error of the ball's height, in heights of the bump",
          "The smooth bump's own trace, by dilation and, independently, from the paper's equation 11.",
          "Every curve falls with the mesh's own error. The tree pays little for more triangles, brute force for "
          "each, and rays on the displaced mesh are ten times less exact: it folds beside the kink.", traced),
    Stage("estimated surface", "root mean square distance from the true body (m), touched and bridged",
          "The wire and the plate themselves; the trace has 20 um of white noise.",
          "Balls on raw noise are biased by its extremes, the more so the denser the samples: those curves do not "
          "fall. Smoothing at the scale that the noise demands turns more samples into less error.", estimated),
    Stage("curvature", "median error of both curvatures over the largest",
          "The bump's closed form (section 2.3 of the paper, misprints mended), checked by 60 decimal digits.",
          "Jets of degree four fall faster with the mesh than libigl's quadratics, which more rings make worse on a "
          "clean mesh.", curvature),
)  # fmt: skip
