"""Joint: the posteriors of all features of a trace, each beside the others."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.joint.refinement import refine_all as refine_all

_PUBLIC = {"refinement": ("refine_all",)}
doorway(__name__, _PUBLIC)
