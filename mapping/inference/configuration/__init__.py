"""Configuration: the features of one neighbourhood are those which together have the highest evidence."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.inference.configuration.account import (
        UNEXPLAINED as UNEXPLAINED,
        accounted as accounted,
        explains as explains,
    )
    from mapping.inference.configuration.configuration import Configuration as Configuration
    from mapping.inference.configuration.neighbourhood import (
        NEIGHBOURHOOD_REACH as NEIGHBOURHOOD_REACH,
        Places as Places,
    )
    from mapping.inference.configuration.proposals import PROPOSALS as PROPOSALS, Proposal as Proposal
    from mapping.inference.configuration.told import (
        in_words as in_words,
        numbers_in as numbers_in,
        share_as_told as share_as_told,
    )
    from mapping.inference.configuration.wide_lines import as_round as as_round, is_two as is_two

_PUBLIC = {
    "account": ("UNEXPLAINED", "accounted", "explains"),
    "configuration": ("Configuration",),
    "neighbourhood": ("NEIGHBOURHOOD_REACH", "Places"),
    "proposals": ("PROPOSALS", "Proposal"),
    "told": ("in_words", "numbers_in", "share_as_told"),
    "wide_lines": ("as_round", "is_two"),
}
doorway(__name__, _PUBLIC)
