"""Stability of curvature: umbilics, scale, place, skinny triangles, and surfaces that are ridges by the letter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from explore3d.stability.table import Answer, Case
from mapping import FloatArray
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.templates import BumpOfRevolution

# Error of quartic jets on meshes of this fineness, from their order of convergence; the bench draws the whole curve.
TRUNCATION = 2e-3


def ball(radius: float = 1.0, count: int = 3000) -> tuple[FloatArray, FloatArray]:
    """Points of a sphere, spread evenly by the golden angle, and their outward normals."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5.0)) * k
    normals = np.column_stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)])
    return radius * normals, normals


def umbilics() -> Answer:
    """A sphere: one curvature, and no direction."""
    points, normals = ball()
    found = principal_curvatures(points, normals=normals)
    error = float(np.nanmax(np.abs(np.concatenate([found.k1, found.k2])[np.tile(found.valid, 2)] - 1.0)))
    none = float(np.mean(~np.isfinite(found.d1[found.valid]).all(axis=1)))
    return Answer(
        f"k within {error:.0e} of 1; {100 * none:.0f} % say that there is no direction", error, 1.0, TRUNCATION,
        "the jets' own error; direction is given only where k1 - k2 exceeds its noise", none > 0.5,
    )  # fmt: skip


def scaled() -> Answer:
    """Curvature times length is a number without unit."""
    points, normals = ball(1.0, 1500)
    points = points * np.array([1.0, 0.8, 0.6])
    reference = principal_curvatures(points, normals=normals).k1
    worst = 0.0
    for scale in (1e-9, 1e-3, 1e3, 1e6):
        other = principal_curvatures(scale * points, normals=normals).k1 * scale
        worst = max(worst, float(np.nanmax(np.abs(other - reference) / np.abs(reference))))
    reason = "second differences over neighbours at a 30th of the size"
    return Answer("1500 points at 4 scales", worst, 1e4, reason=reason)


def powers_of_two() -> Answer:
    """A power of two rescales without any rounding."""
    points, normals = ball(1.0, 1500)
    reference = principal_curvatures(points, normals=normals).k1
    other = principal_curvatures(2.0**20 * points, normals=normals).k1 * 2.0**20
    different = int((~((other == reference) | (np.isnan(other) & np.isnan(reference)))).sum())
    return Answer(f"{different} of 1500 differ", reason="bit for bit", holds=different == 0)


def far_origin(distance: float) -> Callable[[], Answer]:
    """The rounding of the coordinates acts as noise: over neighbours h apart it costs eps x distance / h^2."""

    def run() -> Answer:
        points, normals = ball(1.0, 1500)
        shift = np.array([distance, distance, -distance])
        moved = (points + shift) - shift
        reference = principal_curvatures(moved, normals=normals).k1
        far = principal_curvatures(moved + shift, normals=normals).k1
        error = float(np.nanmax(np.abs(far - reference)))
        return Answer("1500 points", error, distance * 1e4, reason="eps x distance over the square of the spacing")

    return run


def cylinder() -> Answer:
    """One curvature 1/R and one zero."""
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, 120, endpoint=False), np.linspace(-2, 2, 77), indexing="ij")
    normals = np.column_stack([np.cos(turn).ravel(), np.sin(turn).ravel(), np.zeros(turn.size)])
    points = normals + np.column_stack([np.zeros(turn.size), np.zeros(turn.size), z.ravel()])
    inner = np.abs(points[:, 2]) < 1.5
    found = principal_curvatures(points, normals=normals)
    error = float(np.nanmax(np.abs(np.concatenate([found.k1[inner] - 1.0, found.k2[inner]]))))
    return Answer("k1 = 1, k2 = 0", error, 1.0, TRUNCATION, "the jets' own error")


def skinny(method: str) -> Callable[[], Answer]:
    """The paper's bump meshed with triangles as long as 30 times their width: no sign may flip at the crest."""

    def run() -> Answer:
        bump = BumpOfRevolution(15.0)
        mesh = bump.mesh(0.8, 240, 24)
        found = principal_curvatures(mesh, method=method)
        u = np.hypot(*mesh.vertices[:, :2].T)
        crest = (u < 0.08) & (u > 0.01) & found.valid
        true = np.maximum(*bump.curvatures(u[crest]))
        wrong = int((np.sign(found.k1[crest]) != np.sign(true)).sum())
        return Answer(
            f"{wrong} of {int(crest.sum())} crest points have the wrong sign",
            reason="a value that cannot be trusted must say so (valid = False)", holds=wrong == 0,
        )  # fmt: skip

    return run


CURVATURE_CASES = [
    Case("curvature", "umbilics everywhere", "a sphere of 3000 points", umbilics),
    Case("curvature", "cylinder", "9240 points", cylinder),
    Case("curvature", "scale", "the same from 1e-9 to 1e6 m", scaled),
    Case("curvature", "powers of two", "not a bit lost", powers_of_two),
    Case("curvature", "origin 1e3 sizes away", "the same curvatures", far_origin(1e3)),
    Case("curvature", "origin 1e6 sizes away", "the same curvatures", far_origin(1e6)),
    Case("curvature", "skinny triangles, jets", "the sign of the crest's curvature", skinny("jet")),
    Case("curvature", "skinny triangles, libigl", "the sign of the crest's curvature", skinny("libigl")),
]
