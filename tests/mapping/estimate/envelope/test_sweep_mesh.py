"""Meshes of sweeps: complete, well shaped, outward, and good enough for curvature."""

import numpy as np
import pytest
from mesh_borders import border_loops

from mapping.errors import SweepMeshError
from mapping.estimate.envelope.sweep_mesh import mesh_sweeps, zipper
from mapping.estimate.sweeps.rows import parallel_rows, pitch, thinned
from mapping.surface import Surface
from mapping.trace import Trace


def raster(height, pitch=0.05, spacing=0.01, extent=1.0, shuffle=None):
    x = np.arange(-extent, extent + spacing / 2, spacing)
    names = np.arange(-extent, extent + pitch / 2, pitch)
    parts = [np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), y)]) for k, y in enumerate(names)]
    order = np.arange(len(parts)) if shuffle is None else shuffle.permutation(len(parts))
    flat = np.vstack([parts[k] for k in order])
    centers = np.column_stack([flat, height(*flat.T)])
    return Trace(np.arange(len(centers)), centers, np.repeat(np.arange(len(parts)), len(x)), 1.0)


def cap(x, y):
    return np.sqrt(16 - x**2 - y**2) - 4


def smallest_angle(surface: Surface):
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    sides = np.sort(np.stack([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]), axis=0)
    return np.rad2deg(np.arccos((sides[1] ** 2 + sides[2] ** 2 - sides[0] ** 2) / (2 * sides[1] * sides[2])))


def test_parallel_sweeps_are_zippered_without_holes_and_with_every_sample():
    trace = raster(cap)
    mesh = mesh_sweeps(trace, spacing=0.0)
    assert len(mesh.vertices) == len(trace)
    assert border_loops(mesh) == 1
    rows, count = 41, 201
    assert len(mesh.faces) == (rows - 1) * 2 * (count - 1)
    assert (mesh.face_normals[:, 2] > 0.5).all()
    np.testing.assert_allclose(mesh.face_areas @ mesh.face_normals[:, 2], 4.0, rtol=1e-9)


def test_the_mesh_of_thinned_sweeps_is_well_shaped():
    mesh = mesh_sweeps(raster(cap))
    assert np.quantile(smallest_angle(mesh), 0.01) > 25
    assert border_loops(mesh) == 1


def test_sweeps_in_any_order_and_sense_are_put_side_by_side():
    trace = raster(cap, shuffle=np.random.default_rng(0))
    mesh = mesh_sweeps(trace, spacing=0.0)
    np.testing.assert_allclose(mesh.face_areas @ mesh.face_normals[:, 2], 4.0, rtol=1e-9)


def test_a_zipper_joins_polylines_of_any_lengths():
    a = np.column_stack([np.linspace(0, 1, 7), np.zeros(7), np.zeros(7)])
    b = np.column_stack([np.linspace(1, 0, 23), np.ones(23), np.zeros(23)])
    faces = zipper(np.vstack([a, b]), np.arange(7), 7 + np.arange(23))
    assert len(faces) == 7 + 23 - 2
    surface = Surface(np.vstack([a, b]), faces)
    assert border_loops(surface) == 1
    np.testing.assert_allclose(surface.face_areas.sum(), 1.0)
    assert (surface.face_normals[:, 2] > 0).all()


def test_crossing_sweeps_are_triangulated():
    first = raster(cap, pitch=0.1, spacing=0.02)
    centers = first.centers[:, [1, 0, 2]] + np.array([0.003, 0.004, 0.0])
    centers[:, 2] = cap(centers[:, 0], centers[:, 1])
    trace = Trace.concatenate([first, Trace(first.t, centers, first.sweep + 100, 1.0)])
    assert parallel_rows(trace.centers, trace.sweep) is None
    mesh = mesh_sweeps(trace, spacing=0.05)
    assert border_loops(mesh) == 1
    assert (mesh.face_normals[:, 2] > 0).all()


def test_a_cloud_round_a_body_closes():
    rng = np.random.default_rng(0)
    points = rng.standard_normal((500, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    trace = Trace(np.arange(500), points, np.arange(500), 0.1)
    mesh = mesh_sweeps(trace, outward=points, spacing=0.0)
    assert border_loops(mesh) == 0
    assert len(mesh.faces) == 2 * 500 - 4
    assert (np.einsum("ij,ij->i", mesh.face_normals, mesh.vertices[mesh.faces].mean(axis=1)) > 0).all()


def test_circles_round_a_body_are_closed_whatever_their_sense_and_beginning():
    rng = np.random.default_rng(0)
    circles = []
    for k in range(9):
        angle = 2 * np.pi * np.arange(80) / 80
        angle = (angle if rng.random() < 0.5 else -angle) + rng.uniform(0, 6)
        circles.append(np.column_stack([np.cos(angle), np.sin(angle), np.full(80, 0.1 * k)]))
    points = np.vstack(circles)
    trace = Trace(np.arange(720), points, np.repeat(np.arange(9), 80), 0.1)
    mesh = mesh_sweeps(trace, outward=points * [1, 1, 0], spacing=0.0)
    assert border_loops(mesh) == 2
    middle = mesh.vertices[mesh.faces].mean(axis=1) * [1, 1, 0]
    assert (np.einsum("ij,ij->i", mesh.face_normals, middle) > 0.9).all()
    assert mesh.face_areas.sum() == pytest.approx(2 * np.pi * 0.8, rel=2e-3)


@pytest.mark.parametrize("bend", [0.0, 0.2])
def test_libigl_reads_the_right_curvature_from_the_mesh(bend):
    igl = pytest.importorskip("igl")
    trace = raster(lambda x, y: cap(x, y), pitch=0.04)
    centers = trace.centers.copy()
    centers[:, 1] += bend * np.sin(centers[:, 0])
    centers[:, 2] = cap(centers[:, 0], centers[:, 1])
    mesh = mesh_sweeps(Trace(trace.t, centers, trace.sweep, 1.0))
    _, _, k1, k2, _ = igl.principal_curvature(mesh.vertices, mesh.faces, radius=5, useKring=True)
    inner = (np.abs(mesh.vertices[:, :2]) < 0.6).all(axis=1)
    np.testing.assert_allclose(k1[inner], 0.25, rtol=0.03)
    np.testing.assert_allclose(k2[inner], 0.25, rtol=0.03)


def test_zippering_is_fast():
    import time

    trace, seconds = raster(cap, pitch=0.01, spacing=0.002), []
    for _ in range(3):  # the first one loads or compiles the kernels; a busy machine disturbs each of them
        start = time.process_time()
        mesh = mesh_sweeps(trace, spacing=0.0)
        seconds.append(time.process_time() - start)
    assert len(mesh.vertices) / min(seconds) > 2e5


def test_pitch_is_the_distance_between_sweeps():
    trace = raster(cap, pitch=0.05)
    assert pitch(trace.centers, trace.sweep) == pytest.approx(0.05, rel=0.02)
    assert pitch(trace.centers, np.zeros(len(trace), dtype=int)) == 0.0


def test_thinning_keeps_ends_and_what_it_is_told_to():
    x = np.arange(1001) * 1e-3
    points = np.column_stack([x, 0 * x, 0 * x])
    keep = np.zeros(1001, dtype=bool)
    keep[333] = True
    kept = thinned(points, np.zeros(1001, dtype=int), 0.1, keep)
    assert {0, 333, 1000} <= set(kept)
    assert len(kept) <= 13
    assert np.diff(x[kept]).max() < 0.11


def test_samples_on_one_line_make_no_mesh():
    with pytest.raises(SweepMeshError, match="line"):
        mesh_sweeps(Trace.from_profile(np.arange(10.0), np.zeros(10), 1.0))
    with pytest.raises(SweepMeshError, match="line"):
        mesh_sweeps(Trace.from_profile([0.0, 1.0], [0.0, 0.0], 1.0))
