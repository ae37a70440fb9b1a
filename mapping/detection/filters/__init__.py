"""Matched filters: templates of every width, whitened, and the threshold that an asked rate of false alarms needs."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.detection.filters.cap_kernels import cap_products as cap_products, caps as caps
    from mapping.detection.filters.false_alarms import (
        false_alarms_over as false_alarms_over,
        threshold_for as threshold_for,
    )
    from mapping.detection.filters.filter_kernels import dominant as dominant
    from mapping.detection.filters.matched_filter import (
        FILTER_BINS_PER_HALF_WIDTH as FILTER_BINS_PER_HALF_WIDTH,
        LADDER as LADDER,
        Bank as Bank,
        build_bank as build_bank,
        filter_sd as filter_sd,
        smallest_half_width as smallest_half_width,
    )

_PUBLIC = {
    "cap_kernels": ("cap_products", "caps"),
    "false_alarms": ("false_alarms_over", "threshold_for"),
    "filter_kernels": ("dominant",),
    "matched_filter": (
        "Bank",
        "FILTER_BINS_PER_HALF_WIDTH",
        "LADDER",
        "build_bank",
        "filter_sd",
        "smallest_half_width",
    ),
}
doorway(__name__, _PUBLIC)
