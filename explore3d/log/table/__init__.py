"""Tables of numbers as recordings: which column is what, in which unit, in what order, and what does not count."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.table.columns import (
        EVEN as EVEN,
        POSITION as POSITION,
        advances as advances,
        counts as counts,
        find_columns as find_columns,
    )
    from explore3d.log.table.order import sentinels as sentinels
    from explore3d.log.table.read import heights_log as heights_log, read_table as read_table, table_log as table_log
    from explore3d.log.table.settings import (
        TableSettings as TableSettings,
        load_settings as load_settings,
        sidecar_of as sidecar_of,
    )

_PUBLIC = {
    "columns": ("EVEN", "POSITION", "advances", "counts", "find_columns"),
    "order": ("sentinels",),
    "read": ("heights_log", "read_table", "table_log"),
    "settings": ("TableSettings", "load_settings", "sidecar_of"),
}
doorway(__name__, _PUBLIC)
