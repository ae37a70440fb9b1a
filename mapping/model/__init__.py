"""The annotated model: features on the base, written as JSON and GLB, merged, held against tolerances."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.model.comparison import (
        Change as Change,
        Comparison as Comparison,
        compare_models as compare_models,
    )
    from mapping.model.conformity import (
        ANY as ANY,
        DISPROOF as DISPROOF,
        FAIL as FAIL,
        PASS as PASS,
        PROOF as PROOF,
        TOLERATED_SIZES as TOLERATED_SIZES,
        UNDECIDED as UNDECIDED,
        Judgement as Judgement,
        Tolerance as Tolerance,
        judged as judged,
        overall as overall,
    )
    from mapping.model.dropped import dropped_crossings as dropped_crossings, dropped_features as dropped_features
    from mapping.model.feature_mesh import drawn_at_least as drawn_at_least, feature_mesh as feature_mesh
    from mapping.model.json_record import plain as plain
    from mapping.model.merging import merge_model as merge_model
    from mapping.model.object_model import ObjectModel as ObjectModel
    from mapping.model.registration import Registration as Registration, register as register
    from mapping.model.table import SIZES as SIZES, probability as probability, rows as rows
    from mapping.model.touchable import touchable as touchable

_PUBLIC = {
    "comparison": ("Change", "Comparison", "compare_models"),
    "conformity": (
        "ANY",
        "DISPROOF",
        "FAIL",
        "PASS",
        "PROOF",
        "TOLERATED_SIZES",
        "UNDECIDED",
        "Judgement",
        "Tolerance",
        "judged",
        "overall",
    ),
    "dropped": ("dropped_crossings", "dropped_features"),
    "feature_mesh": ("drawn_at_least", "feature_mesh"),
    "json_record": ("plain",),
    "merging": ("merge_model",),
    "object_model": ("ObjectModel",),
    "registration": ("Registration", "register"),
    "table": ("SIZES", "probability", "rows"),
    "touchable": ("touchable",),
}
doorway(__name__, _PUBLIC)
