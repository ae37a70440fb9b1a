"""The base: the global model, its families, extent and pose, and the trace laid on it."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.base.anchor import anchor as anchor, tangent_frame as tangent_frame
    from mapping.base.base import Base as Base, Feet as Feet
    from mapping.base.cells import Cells as Cells, rows_of as rows_of
    from mapping.base.extent import (
        BASE_TRIANGLE_SIZE as BASE_TRIANGLE_SIZE,
        over_base as over_base,
        refined as refined,
        rolled_off as rolled_off,
        touched_part as touched_part,
    )
    from mapping.base.fit import FORETOLD as FORETOLD, fit_base as fit_base
    from mapping.base.height_profile import (
        FEW_SAMPLES_PER_BIN as FEW_SAMPLES_PER_BIN,
        UNEVEN as UNEVEN,
        SweepHeights as SweepHeights,
    )
    from mapping.base.laid_trace import LaidSweep as LaidSweep, LaidTrace as LaidTrace
    from mapping.base.pose import Pose as Pose, estimate_pose as estimate_pose
    from mapping.base.profiles import SHORTEST_LEVEL as SHORTEST_LEVEL, Form as Form
    from mapping.base.projection import (
        WALL_COSINE as WALL_COSINE,
        between_walls as between_walls,
        on_walls as on_walls,
        onto_base as onto_base,
    )
    from mapping.base.quadrics import sheet_moved as sheet_moved
    from mapping.base.terraces import over_levels as over_levels

_PUBLIC = {
    "anchor": ("anchor", "tangent_frame"),
    "base": ("Base", "Feet"),
    "cells": ("Cells", "rows_of"),
    "extent": ("BASE_TRIANGLE_SIZE", "over_base", "refined", "rolled_off", "touched_part"),
    "fit": ("FORETOLD", "fit_base"),
    "height_profile": ("FEW_SAMPLES_PER_BIN", "UNEVEN", "SweepHeights"),
    "laid_trace": ("LaidSweep", "LaidTrace"),
    "pose": ("Pose", "estimate_pose"),
    "profiles": ("SHORTEST_LEVEL", "Form"),
    "projection": ("WALL_COSINE", "between_walls", "on_walls", "onto_base"),
    "quadrics": ("sheet_moved",),
    "terraces": ("over_levels",),
}
doorway(__name__, _PUBLIC)
