"""G-code as the emulated controller understands it: one line becomes one Block, or an error number of Grbl."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from hw import GcodeError

_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))")
MOTIONS = {"G0": "G0", "G1": "G1", "G38.2": "G38.2", "G38.3": "G38.3", "G38.4": "G38.4", "G38.5": "G38.5"}
MODAL_GROUPS = {
    "G17": "plane", "G20": "unit", "G21": "unit", "G90": "distance", "G91": "distance", "G94": "feed",
    "G54": "system", "G55": "system", "G56": "system", "G57": "system", "G58": "system", "G59": "system",
    "G40": "cutter", "G49": "length", "G80": "cancel", "G61": "path",
}  # fmt: skip
ONCE = ("G4", "G10", "G53", "G92", "G92.1")
PROGRAM = ("M0", "M1", "M2", "M30", "M3", "M4", "M5", "M7", "M8", "M9")


@dataclass
class Block:
    """One parsed line.

    Args:
        motion: the motion word in it, or None.
        modes: modal group: word.
        once: commands for this line alone, of ONCE and PROGRAM.
        values: letter: number, axis words included.
    """

    motion: str | None = None
    modes: dict[str, str] = field(default_factory=dict)
    once: set[str] = field(default_factory=set)
    values: dict[str, float] = field(default_factory=dict)

    @property
    def has_axes(self) -> bool:
        """True if there are axis words."""
        return any(axis in self.values for axis in "XYZ")


def parse_block(line: str) -> Block:
    """The block in a line of G-code; comments and spaces are left out.

    Raises:
        GcodeError: with the number that Grbl answers.
    """
    text = re.sub(r"\([^)]*\)|;.*|\s", "", line).upper()
    block, at = Block(), 0
    while at < len(text):
        match = _WORD.match(text, at)
        if match is None:
            raise GcodeError(1 if not text[at].isalpha() else 2)
        _take(block, match[1], float(match[2]))
        at = match.end()
    return block


def _take(block: Block, letter: str, number: float) -> None:
    word = f"{letter}{number:g}"
    if word in MOTIONS:
        if block.motion is not None:
            raise GcodeError(24)
        block.motion = word
    elif word in MODAL_GROUPS:
        if MODAL_GROUPS[word] in block.modes:
            raise GcodeError(21)
        block.modes[MODAL_GROUPS[word]] = word
    elif word in ONCE or word in PROGRAM:
        block.once.add(word)
    elif letter in "GM":
        raise GcodeError(20)
    elif letter in "FLNPSTXYZ":
        if letter in block.values:
            raise GcodeError(25)
        if letter == "F" and number < 0:
            raise GcodeError(4)
        block.values[letter] = number
    else:
        raise GcodeError(20)
