"""Text: a table of numbers as instruments write it; encoding, dialect, header, units and cells are found."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.text.header import role_of as role_of
    from explore3d.log.text.pieces import TEXT_PIECE as TEXT_PIECE, read_pieces as read_pieces
    from explore3d.log.text.read import LEAST_ROWS as LEAST_ROWS, TableText as TableText, read_text as read_text
    from explore3d.log.text.spelling import (
        NO_UNIT as NO_UNIT,
        length_factor as length_factor,
        name_and_unit as name_and_unit,
        time_factor_of as time_factor_of,
    )

_PUBLIC = {
    "header": ("role_of",),
    "pieces": ("TEXT_PIECE", "read_pieces"),
    "read": ("LEAST_ROWS", "TableText", "read_text"),
    "spelling": ("NO_UNIT", "length_factor", "name_and_unit", "time_factor_of"),
}
doorway(__name__, _PUBLIC)
