"""Kinds of features: one file each says all that the house asks of it."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.kinds.bump import bump_shape as bump_shape
    from mapping.inference.kinds.crests import UPRIGHT_RUN as UPRIGHT_RUN
    from mapping.inference.kinds.kind import (
        KINDS as KINDS,
        RIBBON_LIFT as RIBBON_LIFT,
        SECTION_CORNERS as SECTION_CORNERS,
        Kind as Kind,
        Section as Section,
        feature_trace as feature_trace,
        kind_made_of as kind_made_of,
        kind_named as kind_named,
        kind_of as kind_of,
        rise_of as rise_of,
        sizes_of as sizes_of,
    )
    from mapping.inference.kinds.lines import (
        LineKind as LineKind,
        Parameters as Parameters,
        Traced as Traced,
    )
    from mapping.inference.kinds.points import PointKind as PointKind, PointShape as PointShape, Seen as Seen
    from mapping.inference.kinds.posterior_density import (
        felt_beside as felt_beside,
        height_prior as height_prior,
        place_prior as place_prior,
    )

_PUBLIC = {
    "bump": ("bump_shape",),
    "crests": ("UPRIGHT_RUN",),
    "kind": (
        "KINDS",
        "RIBBON_LIFT",
        "SECTION_CORNERS",
        "Kind",
        "Section",
        "feature_trace",
        "kind_made_of",
        "kind_named",
        "kind_of",
        "rise_of",
        "sizes_of",
    ),
    "lines": ("LineKind", "Parameters", "Traced"),
    "points": ("PointKind", "PointShape", "Seen"),
    "posterior_density": ("felt_beside", "height_prior", "place_prior"),
}
doorway(__name__, _PUBLIC)
