"""Stability: digits kept at the extremes, case by case."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.stability.page import stability_page as stability_page
    from explore3d.stability.table import (
        Row as Row,
        as_csv as as_csv,
        cases as cases,
        cells as cells,
        stability as stability,
        summary as summary,
    )

_PUBLIC = {
    "page": ("stability_page",),
    "table": ("Row", "as_csv", "cases", "cells", "stability", "summary"),
}
doorway(__name__, _PUBLIC)
