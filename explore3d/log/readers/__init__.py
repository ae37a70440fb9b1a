"""Readers: one for each kind of file, chosen by what the file holds and not by its name."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.log.readers.reader import Reader as Reader
    from explore3d.log.readers.registry import (
        read_recording as read_recording,
        reader_of as reader_of,
        readers as readers,
    )

_PUBLIC = {"reader": ("Reader",), "registry": ("read_recording", "reader_of", "readers")}
doorway(__name__, _PUBLIC)
