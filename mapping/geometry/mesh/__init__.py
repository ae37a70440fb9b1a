"""Meshes and polylines: trees of triangles, nearest points, parts, threads, files."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.mesh.atomic_write import write_whole as write_whole
    from mapping.geometry.mesh.borrowing_kernels import borrowing as borrowing, inlined as inlined
    from mapping.geometry.mesh.box_kernels import (
        MOST_WAITING as MOST_WAITING,
        POINTS_PER_BOX as POINTS_PER_BOX,
        boxes_about as boxes_about,
        nearest_boxed as nearest_boxed,
        nearest_from as nearest_from,
    )
    from mapping.geometry.mesh.bvh_kernels import (
        STACK as STACK,
        WIDTH as WIDTH,
        lanes as lanes,
        push_lanes as push_lanes,
    )
    from mapping.geometry.mesh.clip import (
        FELT_SIDE_COSINE as FELT_SIDE_COSINE,
        asked_part as asked_part,
        clipped as clipped,
        faces_side as faces_side,
    )
    from mapping.geometry.mesh.nearest import (
        CREASE_ANGLE as CREASE_ANGLE,
        BoxedPoints as BoxedPoints,
        MovedNearestPoint as MovedNearestPoint,
        NearestPoint as NearestPoint,
        side_bulges as side_bulges,
        unit_vectors as unit_vectors,
    )
    from mapping.geometry.mesh.open3d_import import open3d as open3d
    from mapping.geometry.mesh.polyline import (
        arclengths as arclengths,
        directions as directions,
        distances as distances,
        middle as middle,
        nearest_on as nearest_on,
        resample as resample,
    )
    from mapping.geometry.mesh.spline import Spline as Spline, spline_design as spline_design
    from mapping.geometry.mesh.threads import (
        NEAREST_COST as NEAREST_COST,
        algebra_in_one_thread as algebra_in_one_thread,
        by_shares as by_shares,
        cores as cores,
    )
    from mapping.geometry.mesh.tree import TriangleTree as TriangleTree
    from mapping.geometry.mesh.triangle_kernels import (
        closest_on_triangle as closest_on_triangle,
        closing_step as closing_step,
        enter_face as enter_face,
        enter_triangle as enter_triangle,
    )
    from mapping.geometry.mesh.triangle_row_kernels import (
        QUERIES_PER_BLOCK as QUERIES_PER_BLOCK,
        closest as closest,
        corners as corners,
    )
    from mapping.geometry.mesh.vector_kernels import (
        cross as cross,
        dot as dot,
        moved as moved,
        scaled as scaled,
        sub as sub,
        vector as vector,
    )

_PUBLIC = {
    "spline": ("Spline", "spline_design"),
    "atomic_write": ("write_whole",),
    "borrowing_kernels": ("borrowing", "inlined"),
    "box_kernels": ("MOST_WAITING", "POINTS_PER_BOX", "boxes_about", "nearest_boxed", "nearest_from"),
    "bvh_kernels": ("STACK", "WIDTH", "lanes", "push_lanes"),
    "clip": ("FELT_SIDE_COSINE", "asked_part", "clipped", "faces_side"),
    "nearest": ("CREASE_ANGLE", "BoxedPoints", "MovedNearestPoint", "NearestPoint", "side_bulges", "unit_vectors"),
    "open3d_import": ("open3d",),
    "polyline": ("arclengths", "directions", "distances", "middle", "nearest_on", "resample"),
    "threads": ("NEAREST_COST", "algebra_in_one_thread", "by_shares", "cores"),
    "tree": ("TriangleTree",),
    "triangle_kernels": ("closest_on_triangle", "closing_step", "enter_face", "enter_triangle"),
    "triangle_row_kernels": ("QUERIES_PER_BLOCK", "closest", "corners"),
    "vector_kernels": ("cross", "dot", "moved", "scaled", "sub", "vector"),
}
doorway(__name__, _PUBLIC)
