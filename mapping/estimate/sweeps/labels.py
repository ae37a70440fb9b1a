"""Labels of estimated points: touched, bridged, extrapolated."""

from __future__ import annotations

TOUCHED, BRIDGED, EXTRAPOLATED = 0, 1, 2


LABELS = ("touched", "bridged", "extrapolated")
