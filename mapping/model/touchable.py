"""Touchable: an annotated model as a body that a proxy can be led over."""

from __future__ import annotations

import numpy as np

from mapping import LeftOut, ModelError
from mapping.geometry.proxy import ProxyBody
from mapping.inference.kinds import kind_of
from mapping.model.object_model import ObjectModel

# Features may be made larger by so much for the hand
MOST_EXAGGERATION = 100.0


def touchable(
    model: ObjectModel, tip_radius: float, exaggeration: float = 1.0
) -> tuple[ProxyBody, tuple[LeftOut, ...]]:
    """The base with its features' closed forms, and the features that have none.

    Args:
        model: what was found.
        tip_radius: of the ball that shall touch it, m; it need not be the one that explored it.
        exaggeration: factor of the features' sections, heights and widths, 1 to 100.

    Raises:
        ModelError: an exaggeration out of range.
        ContactError: a radius or sizes that are not positive and finite.
    """
    if not (np.isfinite(exaggeration) and 1.0 <= exaggeration <= MOST_EXAGGERATION):
        raise ModelError(
            f"features are exaggerated by a factor from 1 to {MOST_EXAGGERATION:g}; found {exaggeration!r}"
        )
    parts, left_out = [], []
    for feature in model.features:
        # a free section is known where it was crossed, by no form
        part = None if feature.details.free_section else kind_of(feature).part(feature, exaggeration)
        if part is None:
            left_out.append(
                LeftOut(feature.id, f"a {feature.kind} of which no closed form, or no higher side, is known")
            )
        else:
            parts.append(part)
    return ProxyBody(model.base.surface, parts, tip_radius), tuple(left_out)
