"""Profiles: the base of a trace along one line; its form as the evidence or its user says."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.base.profiles.edges import EDGE_FREEDOM as EDGE_FREEDOM
    from mapping.base.profiles.fit_profile import SHORTEST_BEND as SHORTEST_BEND, fit_profile as fit_profile
    from mapping.base.profiles.form import AUTO as AUTO, Form as Form
    from mapping.base.profiles.frame import profile_frame as profile_frame
    from mapping.base.profiles.isolated_bends import isolated_rest as isolated_rest
    from mapping.base.profiles.jumps import SHORTEST_LEVEL as SHORTEST_LEVEL

_PUBLIC = {
    "edges": ("EDGE_FREEDOM",),
    "fit_profile": ("SHORTEST_BEND", "fit_profile"),
    "form": ("AUTO", "Form"),
    "frame": ("profile_frame",),
    "isolated_bends": ("isolated_rest",),
    "jumps": ("SHORTEST_LEVEL",),
}
doorway(__name__, _PUBLIC)
