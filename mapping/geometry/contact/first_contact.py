"""Contact: where a ball that moves towards a body first touches it (the paper's traced surface)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping import BoolArray, ContactError, FloatArray, IntArray, Surface
from mapping.geometry.contact.commanded_path import CommandedPath, checked_points, unit_directions
from mapping.geometry.contact.query_order import morton_order
from mapping.geometry.mesh import TriangleTree

NONE, FACE, EDGE, VERTEX = 0, 1, 2, 3
# Queries over details take longer than those over a flat part, and cores are lent to others: of two equal shares one
# ends last. With eight each a thread waits for an eighth of its share at most
PARTS_PER_THREAD = 8


@dataclass(frozen=True, eq=False)
class Contacts:
    """Places where a ball rests on a body, one for each of N queries.

    Args:
        centers: (N, 3) ball centres at contact, m; NaN where there is none.
        points: (N, 3) points of the body that the ball touches, m; NaN where there is none.
        normals: (N, 3) unit normals there, out of the body towards the ball; NaN where there is none.
        feature: (N,) what of the mesh is touched: NONE, FACE, EDGE or VERTEX.
        count: (N,) number of places touched at once. 0: the ball passes by, or `overlap`. 2 or more: an
            interference point. Places within 1e-9 radii of the ball's surface are touched; places closer
            together than 9e-5 radii are one (a dent that narrow is shallower than that). At most 16.
        distance: (N,) length of the way to the contact, m; inf where there is none.
        overlap: (N,) True where the ball already overlaps the body, by more than 1e-9 radii, at its
            start: then count and distance are 0 and there is no contact to report.
    """

    centers: FloatArray
    points: FloatArray
    normals: FloatArray
    feature: NDArray[np.int8]
    count: IntArray
    distance: FloatArray
    overlap: BoolArray

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def interference(self) -> BoolArray:
        """(N,) True at interference points: the ball touches two places or more."""
        return np.asarray(self.count >= 2)

    def select(self, index: BoolArray | IntArray) -> Contacts:
        """The queries that a mask or an index array picks."""
        return Contacts(**{name: array[index] for name, array in vars(self).items()})


class BallContact:
    """A ball and a body prepared for contact queries, exact to float64.

    The body is any triangle mesh: open or closed, welded or not, its faces touched from both sides. A ball's
    gap to a triangle is a convex function of its way, so tangents to it lead to the contact and never beyond:
    there is no crack between faces, edges and vertices to slip through (theory 4.7). A tree of boxes leaves
    out those that the ball surely misses.

    Positions are exact to a few 1e-16 of the larger of body, ball and distance from the coordinates'
    origin. A ball that would sink in by less than 2e-15 of body and ball merely grazes, and passes; it never
    sinks in by more than 2e-14.

    Args:
        surface: the body.
        tip_radius: radius of the ball, m, positive and at least 1e-13 of the body's size.

    Raises:
        ContactError: a radius that is not positive and finite, or too small for the body.
    """

    def __init__(self, surface: Surface, tip_radius: float) -> None:
        from mapping.geometry.contact import contact_kernels

        self.surface = surface
        self.tip_radius = _checked_radius(tip_radius)
        self._tree = tree = TriangleTree(surface, self.tip_radius)
        if not np.isfinite(tree.extent) or self.tip_radius < 1e-13 * tree.extent:
            raise ContactError(
                f"a ball of radius {self.tip_radius:g} m is too small for a body of {tree.extent:g} m: "
                "float64 tells no less than 1e-13 of the body's size apart"
            )
        radius = float(tree.scale_in(self.tip_radius))
        graze = 8 * float(np.finfo(float).eps) * (tree.size + radius)
        self._ball = (radius, radius * (1.0 + contact_kernels.CONTACT_TOLERANCE) + graze, graze)

    def first_contact(self, origins: ArrayLike, directions: ArrayLike, threads: int = 1) -> Contacts:
        """The first contact of balls that start centred at the origins and move straight along the directions.

        A ball that starts in contact is stopped there (distance 0) if it presses in, and free to move
        away. A ball that starts overlapping the body has no first contact: see `Contacts.overlap`.

        Args:
            origins: (N, 3) starting centres, m.
            directions: (N, 3) or (3,) directions of motion, of any length but zero.
            threads: processor cores to use; the answer is the same to the last bit.

        Raises:
            ContactError: wrong shapes, values that are not finite, a direction of length zero.
        """
        from mapping.geometry.contact import packet_kernels
        from mapping.geometry.mesh import QUERIES_PER_BLOCK

        start = checked_points(origins, "origins")
        way, tree = unit_directions(directions, len(start)), self._tree
        turn = morton_order(start)
        centers, points, normals = (np.empty((len(start), 3)) for _ in range(3))
        feature, count, distance = np.empty(len(start), np.int8), np.empty(len(start), np.int64), np.empty(len(start))
        overlap = np.empty(len(start), np.bool_)

        def some(part: slice) -> None:
            packet_kernels.first_contacts(
                tree.rows, tree.order, tree.leaves, tree.boxes, tree.links, self._ball, tree.size, tree.frame,
                turn, part.start, part.stop, start, way, centers, points, normals, feature, count, distance, overlap,
            )  # fmt: skip

        _in_parts(some, len(start), QUERIES_PER_BLOCK, threads)
        return Contacts(centers, points, normals, feature, count, distance, overlap)

    def press(self, centers: ArrayLike, approach: ArrayLike, threads: int = 1) -> Contacts:
        """Where balls rest that are commanded to the centres and pressed along the approach, each on its own.

        A ball that is free where it is commanded to presses on. Else it first backs off against the
        approach, only as far as it must to be free: so a ball in a hollow or under an overhang stays there.
        A centre inside the body (the first face behind it turns its back) leaves the body that way first.

        Args:
            centers: (N, 3) commanded centres, m.
            approach: (N, 3) or (3,) directions of pressing, of any length but zero.
            threads: processor cores to use.

        Returns:
            Contacts whose `distance` is measured from the commanded centres along the approach: negative
            where the ball had to back off.

        Raises:
            ContactError: wrong shapes, values that are not finite, an approach of length zero.
        """
        from mapping.geometry.contact import retreat_kernels
        from mapping.geometry.mesh import QUERIES_PER_BLOCK

        commanded = checked_points(centers, "commanded centres")
        way = np.broadcast_to(unit_directions(approach, len(commanded)), commanded.shape)
        back = np.empty(len(commanded))
        tree, local, outward = self._tree, self._tree.into(commanded), self._outward

        def some(part: slice) -> None:
            retreat_kernels.retreats(
                tree.rows, tree.leaves, tree.boxes, tree.links, self._ball, tree.size, outward,
                local[part], -way[part], back[part],
            )  # fmt: skip

        _in_parts(some, len(commanded), QUERIES_PER_BLOCK, threads)
        back = tree.scale_out(back)
        rest = self.first_contact(commanded - back[:, None] * way, way, threads)
        return replace(rest, distance=rest.distance - back)

    def slide(self, path: ArrayLike, approach: ArrayLike, spacing: float) -> Contacts:
        """The ball's path while it follows a commanded path, pressed along the approach.

        Every sample is pressed on its own (see `press`), so the ball gets over what it could not climb.

        Args:
            path: (K, 3) corners of the commanded path of the ball's centre, m.
            approach: (3,) or (K, 3) directions of pressing, interpolated between the corners.
            spacing: largest distance of neighbouring samples along the path, m.

        Returns:
            Contacts at the N samples, the path's corners among them.

        Raises:
            ContactError: wrong shapes, values that are not finite, a spacing that is not positive.
        """
        commanded = CommandedPath(path, approach)
        return self.press(*commanded.at(commanded.places(spacing)))

    @cached_property
    def _outward(self) -> float:
        """-1 for a closed body whose faces are turned inside out, else +1."""
        a, b, c = (self._tree.into(self.surface.vertices)[self.surface.faces[:, i]] for i in range(3))
        areas = np.cross(b - a, c - a)
        closed = np.abs(areas.sum(axis=0)).max() <= 1e-9 * np.abs(areas).sum()
        return -1.0 if closed and np.einsum("ij,ij->", a, areas) < 0.0 else 1.0


def _checked_radius(tip_radius: float) -> float:
    radius = float(tip_radius)
    if not (np.isfinite(radius) and radius > 0):
        raise ContactError(f"tip radius must be a positive length in metres; found {tip_radius!r}")
    return radius


def _in_parts(work: Callable[[slice], None], count: int, block: int, threads: int) -> None:
    """Do the work on slices of whole blocks; each thread takes the next one when it is free."""
    if threads < 1:
        raise ContactError(f"threads must be at least 1; found {threads}")
    most = 1 if threads == 1 else threads * PARTS_PER_THREAD
    size = max(-(-count // (block * most)), 1) * block
    parts = [slice(first, min(first + size, count)) for first in range(0, count, size)]
    if len(parts) <= 1:
        for part in parts:
            work(part)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, parts))
