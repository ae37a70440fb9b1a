"""Devices that a display may be asked for by name: the simulated one, and what installed packages add.

A package names its devices as entry points in the group `explore3d.displays`; each is a callable without arguments that
gives a `hw.display.Display`, not yet open. None is imported unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType

from explore3d import UserError
from hw.display import Display

DISPLAY_GROUP = "explore3d.displays"
SIMULATED = "simulated"


@cache
def displays() -> Mapping[str, EntryPoint]:
    """The devices of installed packages, by name."""
    return MappingProxyType({point.name: point for point in entry_points(group=DISPLAY_GROUP)})


def display_device(name: str) -> Display:
    """The device of that name, not yet open.

    Raises:
        UserError: none is called so, or its package cannot be loaded or gives something else.
    """
    known = displays()
    if name not in known:
        raise UserError(
            f"--device: unknown display {name!r}; possible: {', '.join([SIMULATED, *sorted(known)])}; others come with "
            f"packages that have an entry point in {DISPLAY_GROUP}"
        )
    point = known[name]
    what = f"entry point {point.name} = {point.value} of {DISPLAY_GROUP}"
    try:
        device = point.load()()
    except Exception as error:  # another's package may raise whatever it likes while it is imported
        raise UserError(f"{what} cannot be loaded: {type(error).__name__}: {error}; mend that package") from error
    if not isinstance(device, Display):
        raise UserError(f"{what} gives no hw.display.Display; found {type(device).__name__}")
    return device
