"""Configuration: the features of one neighbourhood are those which together have the highest evidence."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.configuration.account import (
        accounted as accounted,
        count_in as count_in,
        in_words as in_words,
    )
    from mapping.inference.configuration.neighbourhood import Places as Places
    from mapping.inference.configuration.proposals import PROPOSALS as PROPOSALS, Proposal as Proposal

_PUBLIC = {
    "account": ("accounted", "count_in", "in_words"),
    "neighbourhood": ("Places",),
    "proposals": ("PROPOSALS", "Proposal"),
}
doorway(__name__, _PUBLIC)
