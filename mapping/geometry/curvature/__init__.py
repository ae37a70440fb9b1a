"""Principal curvatures of meshes and clouds."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.curvature.curvature import Curvature as Curvature
    from mapping.geometry.curvature.jet import TOLD_SIDE as TOLD_SIDE
    from mapping.geometry.curvature.neighbours import Neighbours as Neighbours
    from mapping.geometry.curvature.principal_curvatures import principal_curvatures as principal_curvatures

_PUBLIC = {
    "curvature": ("Curvature",),
    "jet": ("TOLD_SIDE",),
    "neighbours": ("Neighbours",),
    "principal_curvatures": ("principal_curvatures",),
}
doorway(__name__, _PUBLIC)
