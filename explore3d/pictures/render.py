"""Render: shaded pictures of meshes, without a screen and in a tenth of a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explore3d.pictures.camera import Camera
from mapping import FloatArray, IntArray, Surface

# Creases sharper than this keep their edge; flatter ones are shaded round.
CREASE_COSINE = np.cos(np.radians(35.0))
AMBIENT = 0.55
# The light stands to the left of the camera and above it, seen from below beneath it: a face turned down would lie in
# the shadow, and what is drawn on it with it. So far aside, for a distance of one; in full where a camera rises by 0.4
BESIDE_CAMERA, ABOVE_CAMERA, RISEN = 0.45, 0.65, 0.4
BRIGHTEST = 1.06
OUTLINE = 0.55
# The depth bends at a silhouette by more than so many footprints of a pixel
OUTLINE_PIXELS = 12.0


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh with a colour per vertex: `colours` (V, 3) or (3,), red, green, blue from 0 to 1."""

    surface: Surface
    colours: FloatArray


@dataclass
class Picture:
    """Pixels (H, W, 3) from 0 to 1 and depth (H, W) along the view, m (inf: background); splats draw into it.

    Args:
        seen: (H, W) face that each pixel sees, -1: none.
        flat: (F, 3) unit normals of the faces.
    """

    camera: Camera
    pixels: NDArray[np.float32]
    depth: NDArray[np.float32]
    seen: NDArray[np.int32]
    flat: FloatArray

    def normals(self, row: IntArray, column: IntArray) -> FloatArray:
        """(N, 3) unit normals of what pixels see, turned towards the camera; all must see something."""
        normals = self.flat[self.seen[row, column]]
        away = np.einsum("ij,ij->i", normals, self.camera.rays(row, column)) > 0.0
        return np.where(away[:, None], -normals, normals)

    def splat(self, points: FloatArray, colours: FloatArray, radius: float, bias: float) -> None:
        """Draw discs of `radius` pixels at points (N, 3), m, where nothing is more than `bias` m in front.

        Args:
            points: later points cover earlier ones.
            colours: (N, 3).
        """
        from explore3d.pictures.render_kernels import splat

        place, depth = self.camera.project(points)
        shades = np.ascontiguousarray(np.broadcast_to(colours, points.shape))
        splat(place[:, 0].copy(), place[:, 1].copy(), depth.copy(), shades, radius, bias, self.depth, self.pixels)

    def reduced(self, factor: int) -> NDArray[np.uint8]:
        """(H / factor, W / factor, 3) pixels from 0 to 255, averaged: edges become smooth.

        A row at a time: sums for all of them are 7 MB on top of the most that a run takes.
        """
        height, width = self.camera.height // factor, self.camera.width // factor
        averaged = np.empty((height, width, 3), dtype=np.uint8)
        for row in range(height):
            sums = np.zeros((width, 3), dtype=np.float32)
            for pixels in self.pixels[row * factor : (row + 1) * factor]:
                for column in range(factor):
                    sums += pixels[column : width * factor : factor]
            sums *= 255.0 / factor**2
            averaged[row] = np.rint(sums, out=sums)
        return averaged


def render(bodies: Sequence[Body], camera: Camera) -> Picture:
    """The bodies as the camera sees them, lit from beside the camera, with outlines where the depth jumps."""
    from explore3d.pictures.render_kernels import outline, see, shade

    right, up, forward = camera.frame
    counts = np.cumsum([0, *(len(body.surface.vertices) for body in bodies)])
    faces = np.concatenate([body.surface.faces + first for body, first in zip(bodies, counts[:-1], strict=True)])
    corners = np.concatenate([(body.surface.vertices - camera.eye) @ np.stack(camera.frame, axis=1) for body in bodies])
    flat = np.concatenate([body.surface.face_normals for body in bodies])
    bent, bends = _corner_normals(flat, np.concatenate([body.surface.face_areas for body in bodies]), faces)
    colours = np.concatenate([np.broadcast_to(body.colours, body.surface.vertices.shape) for body in bodies])
    shape = camera.height, camera.width
    depth, seen = np.full(shape, np.inf, dtype=np.float32), np.full(shape, -1, dtype=np.int32)
    pixels = np.empty((*shape, 3), dtype=np.float32)
    see(corners, faces, camera.pixel, depth, seen, pixels)
    light = -forward - BESIDE_CAMERA * right + ABOVE_CAMERA * np.clip(-forward[2] / RISEN, -1.0, 1.0) * up
    light = light / np.linalg.norm(light)
    first = forward + camera.pixel * (0.5 * (camera.height - 1) * up - 0.5 * (camera.width - 1) * right)
    rays = np.stack([camera.pixel * right, -camera.pixel * up, first])
    shade(seen, faces, flat, bent, bends, colours, light, rays, AMBIENT, BRIGHTEST, pixels)
    outline(depth, OUTLINE_PIXELS * camera.pixel, OUTLINE, pixels)
    return Picture(camera, pixels, depth, seen, flat)


def _corner_normals(flat: FloatArray, areas: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Unit normals (N, 3) that a surface is shaded by, and (F, 3) which of them serves each corner of a face.

    The mean of the faces at a vertex, weighted by area, if all of them bend by less than a crease from it; else each
    face has its own, of those that bend by less from itself: a narrow side is not tilted by the wide face beside it.

    Args:
        flat: (F, 3) unit normals of the faces.
        areas: (F,) theirs, m^2.
        faces: (F, 3) vertices.
    """
    from explore3d.pictures.render_kernels import sums_of_alike

    weighted, corners = flat * areas[:, None], faces.ravel()
    count = int(faces.max(initial=-1)) + 1
    sums = [np.bincount(corners, np.repeat(weighted[:, axis], 3), minlength=count) for axis in range(3)]
    at_vertices = _unit(np.stack(sums, axis=1))
    beyond = np.einsum("fj,fkj->fk", flat, at_vertices[faces]).ravel() <= CREASE_COSINE
    creased = np.zeros(len(at_vertices), dtype=bool)
    creased[corners[beyond]] = True
    own = np.flatnonzero(creased[corners])
    own = own[np.argsort(corners[own], kind="stable")]  # those of a vertex in a row
    at_corners = _unit(sums_of_alike(flat, weighted, own // 3, corners[own], CREASE_COSINE))
    bends = corners.copy()
    bends[own] = len(at_vertices) + np.arange(len(own))
    return np.concatenate([at_vertices, at_corners]), bends.reshape(-1, 3)


def _unit(vectors: FloatArray) -> FloatArray:
    """Vectors (N, 3) at unit length."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))
