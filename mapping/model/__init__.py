"""The annotated model: features on the base, written as JSON and GLB, merged."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.model.dropped import dropped_crossings as dropped_crossings, dropped_features as dropped_features
    from mapping.model.feature_mesh import drawn_at_least as drawn_at_least, feature_mesh as feature_mesh
    from mapping.model.merging import merge_model as merge_model
    from mapping.model.object_model import ObjectModel as ObjectModel

_PUBLIC = {
    "dropped": ("dropped_crossings", "dropped_features"),
    "feature_mesh": ("drawn_at_least", "feature_mesh"),
    "merging": ("merge_model",),
    "object_model": ("ObjectModel",),
}
doorway(__name__, _PUBLIC)
