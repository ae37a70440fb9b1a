"""The base as an event of the log: a log can be analysed where the scene's mesh files are not at hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from explore3d.errors import UserError
from explore3d.recording import Event
from mapping.base import Base
from mapping.errors import SurfaceError
from mapping.surface import Surface

KIND = "base"


def base_event(base: Base) -> dict[str, Any]:
    """JSON values that `read_base` turns back into the same base, bit for bit."""
    return {
        "kind": base.kind,
        "parameters": base.parameters,
        "vertices": base.surface.vertices.tolist(),
        "faces": base.surface.faces.tolist(),
    }


def read_base(events: Sequence[Event]) -> Base | None:
    """The last base that the events hold, None if none does.

    Raises:
        UserError: a base event that is not one.
    """
    for event in reversed(events):
        if event.kind == KIND:
            try:
                surface = Surface(event.data["vertices"], event.data["faces"])
                return Base(surface, event.data["kind"], event.data["parameters"])
            except (KeyError, SurfaceError) as error:
                raise UserError(f"the log's base event is not readable: {error}") from error
    return None
