"""Raycast: shaded pictures of meshes by rays through Open3D's RaycastingScene, without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explore3d.pictures.camera import Camera
from mapping import FloatArray, IntArray, Surface
from mapping.geometry.mesh import open3d

BACKGROUND = np.ones(3)
# Creases sharper than this keep their edge; flatter ones are shaded round.
CREASE_COSINE = np.cos(np.radians(35.0))
AMBIENT = 0.55
OUTLINE = 0.55


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh with a colour per vertex: `colours` (V, 3) or (3,), red, green, blue from 0 to 1."""

    surface: Surface
    colours: FloatArray


@dataclass
class Picture:
    """Pixels (H, W, 3) from 0 to 1 and depth (H, W) along the view, m (inf: background); splats draw into it."""

    camera: Camera
    pixels: FloatArray
    depth: FloatArray

    def splat(self, points: FloatArray, colours: FloatArray, radius: float, bias: float) -> None:
        """Draw discs of `radius` pixels at points (N, 3), m, where nothing is more than `bias` m in front.

        Args:
            points: later points cover earlier ones.
            colours: (N, 3).
        """
        place, depth = self.camera.project(points)
        keep = np.isfinite(place).all(axis=1)
        centre = np.rint(place[keep]).astype(np.int64)
        depth, shade = depth[keep], np.broadcast_to(colours, points.shape)[keep]
        reach = int(np.ceil(radius))
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if dx * dx + dy * dy > radius * radius + 0.25:
                    continue
                column, row = centre[:, 0] + dx, centre[:, 1] + dy
                inside = (column >= 0) & (column < self.camera.width) & (row >= 0) & (row < self.camera.height)
                column, row, front = column[inside], row[inside], depth[inside] - bias
                seen = front <= self.depth[row, column]
                self.pixels[row[seen], column[seen]] = shade[inside][seen]

    def reduced(self, factor: int) -> FloatArray:
        """(H / factor, W / factor, 3) pixels, averaged: edges become smooth."""
        height, width = self.camera.height // factor, self.camera.width // factor
        return np.asarray(self.pixels.reshape(height, factor, width, factor, 3).mean(axis=(1, 3)))


def render(bodies: Sequence[Body], camera: Camera) -> Picture:
    """The bodies as the camera sees them, lit from beside the camera, with outlines where the depth jumps."""
    core = open3d().core
    scene = open3d().t.geometry.RaycastingScene()
    scale = max(body.surface.size for body in bodies)
    for body in bodies:
        # Open3D computes in float32: the camera's target is its origin, and the bodies' size its unit.
        local = ((body.surface.vertices - camera.target) / scale).astype(np.float32)
        scene.add_triangles(core.Tensor(local), core.Tensor(body.surface.faces.astype(np.uint32)))
    directions = camera.rays()
    eye = np.broadcast_to((camera.eye - camera.target) / scale, directions.shape)
    rays = np.concatenate([eye, directions], axis=2).astype(np.float32)
    hit = {name: value.numpy() for name, value in scene.cast_rays(core.Tensor(rays)).items()}
    pixels = np.broadcast_to(BACKGROUND, directions.shape).copy()
    for number, body in enumerate(bodies):
        mask = hit["geometry_ids"] == number
        pixels[mask] = _shade(body, hit["primitive_ids"][mask], hit["primitive_uvs"][mask], directions[mask], camera)
    depth = hit["t_hit"].astype(np.float64) * scale
    return Picture(camera, _outlined(pixels, depth, camera), depth)


def _shade(body: Body, face: NDArray[np.uint32], uv: FloatArray, ray: FloatArray, camera: Camera) -> FloatArray:
    """Colours (N, 3) of the hits: Lambert's law for a light to the upper left behind the camera."""
    surface = body.surface
    weights = np.column_stack([1.0 - uv.sum(axis=1), uv])
    flat = surface.face_normals[face]
    bent = _vertex_normals(surface)
    rounded = (np.einsum("fj,fkj->fk", surface.face_normals, bent[surface.faces]) > CREASE_COSINE).all(axis=1)[face]
    normal = flat.copy()
    normal[rounded] = _mixed(bent, surface.faces[face[rounded]], weights[rounded])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    # Open surfaces are seen from both sides.
    normal = np.where(np.einsum("ij,ij->i", flat, ray)[:, None] > 0, -normal, normal)
    right, up, forward = camera.frame
    light = -forward - 0.45 * right + 0.65 * up
    shine = np.clip(normal @ (light / np.linalg.norm(light)), 0.0, 1.0)
    colour = body.colours if body.colours.ndim == 1 else _mixed(body.colours, surface.faces[face], weights)
    return np.asarray(np.clip(colour * (AMBIENT + (1.06 - AMBIENT) * shine)[:, None], 0.0, 1.0))


def _mixed(values: FloatArray, corners: IntArray, weights: FloatArray) -> FloatArray:
    """(N, 3) values at the corners (N, 3) of faces, weighted by barycentric coordinates (N, 3)."""
    return np.asarray(sum(values[corners[:, i]] * weights[:, i, None] for i in range(3)))


def _vertex_normals(surface: Surface) -> FloatArray:
    """(V, 3) normals weighted by area, not of unit length."""
    sums = np.zeros_like(surface.vertices)
    for corner in range(3):
        np.add.at(sums, surface.faces[:, corner], surface.face_normals * surface.face_areas[:, None])
    return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), np.finfo(float).tiny))


def _outlined(pixels: FloatArray, depth: FloatArray, camera: Camera) -> FloatArray:
    """Pixels darkened at silhouettes: where the depth bends by much more than the footprint of a pixel."""
    if not np.isfinite(depth).any():
        return pixels
    finite = np.where(np.isfinite(depth), depth, 1e3 * np.nanmax(np.where(np.isfinite(depth), depth, np.nan)))
    bend = np.zeros_like(finite)
    bend[1:-1] += np.abs(finite[2:] - 2 * finite[1:-1] + finite[:-2])
    bend[:, 1:-1] += np.abs(finite[:, 2:] - 2 * finite[:, 1:-1] + finite[:, :-2])
    jump = (bend > 12.0 * camera.pixel * finite) & np.isfinite(depth)
    pixels[jump] *= OUTLINE
    return pixels
