"""Curves on a base: Fermi coordinates, developments, smooth axes."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.curves.axis_kernels import axes_about as axes_about
    from mapping.inference.curves.body_edge import up_to_edges as up_to_edges
    from mapping.inference.curves.chart import Chart as Chart, chart_along as chart_along
    from mapping.inference.curves.curve_modes import CurveModes as CurveModes
    from mapping.inference.curves.development import normals_along as normals_along, smooth_on_base as smooth_on_base
    from mapping.inference.curves.mouth import (
        Mouth as Mouth,
        edges_along as edges_along,
        ends_on_face as ends_on_face,
        laid_beyond as laid_beyond,
        mouths_of as mouths_of,
        opened as opened,
    )
    from mapping.inference.curves.smooth_axis import HIGHEST_DEGREE as HIGHEST_DEGREE, smooth_axis as smooth_axis

_PUBLIC = {
    "axis_kernels": ("axes_about",),
    "body_edge": ("up_to_edges",),
    "chart": ("Chart", "chart_along"),
    "curve_modes": ("CurveModes",),
    "development": ("normals_along", "smooth_on_base"),
    "mouth": ("Mouth", "edges_along", "ends_on_face", "laid_beyond", "mouths_of", "opened"),
    "smooth_axis": ("HIGHEST_DEGREE", "smooth_axis"),
}
doorway(__name__, _PUBLIC)
