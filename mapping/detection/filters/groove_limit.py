"""Groove limit: the narrowest groove that a sweep across it shows as surely as a sharp crest of a height.

A ball sinks into a groove that it bridges as far as the width lets it, however deep the groove is; so what is seen of
one is its width.
"""

from __future__ import annotations

import numpy as np

from mapping.geometry.templates import rim_height

# Signal-to-noise ratio of a dip between two rims against that of a crest as high, in white noise (theory equation
# 4.10: the integrals of (1 - x)^4 and (1 - x^2)^2); noise that is correlated takes less of a dip, never more
DIP = float(np.sqrt(3.0 / 8.0))
# Share of it that is left by the filters, which are made for crests: the nearest, 0.61 as wide, correlates with it by
# 0.984; of 900 grooves in six noises, as wide as that says, 94.4 % were found in place of 95, which is 0.9 % of it more
DIP_IN_FILTER = 0.975
# Height of the crest that stands out as much as a dip, in depths of that: a signal grows as the height to the power 5/4
CREST_PER_DIP = float((DIP * DIP_IN_FILTER) ** 0.8)


def narrowest_groove(crest: float, tip_radius: float) -> float:
    """Width from which on a groove is seen with the probability with which a crest is, m; infinite where not even one
    as wide as the ball is: what is wider is felt to its bottom.

    Args:
        crest: height of the sharp crest, m.
        tip_radius: m.

    Reference: theory equations 4.9 and 4.10.
    """
    dip = groove_dip(crest)
    return 2.0 * float(np.sqrt(dip * (2.0 * tip_radius - dip))) if dip < tip_radius else float("inf")


def groove_dip(crest: float) -> float:
    """How far the ball sinks into a groove that is as hard to see as a crest of that height, m."""
    return crest / CREST_PER_DIP


def crest_like_groove(width: float, tip_radius: float) -> float:
    """Height of the sharp crest that is as hard to see as a groove of a width that the ball does not fill, m."""
    return CREST_PER_DIP * float(-rim_height(min(0.5 * width, tip_radius), tip_radius))
