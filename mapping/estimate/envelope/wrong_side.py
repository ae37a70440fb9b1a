"""Wrong side: a trace whose kinks say that the body lies on the other side of the path than its base says.

Positions alone do not say from which side a ball touched. Its path bends outwards no more sharply than the ball, and
has kinks inwards, where it touches twice: seen from the wrong side those point outwards. Outliers bend to either side.

Reference: theory section 4.9.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from mapping.base import LaidTrace
from mapping.estimate.envelope.refuted_tip import REFUTED_BY_CHANCE, sharp_bends

# Share of the bends of outliers that point outwards, at most: a dip has two shoulders and one bottom. Tables with 300
# dips of 2 to 6 samples each, all downwards, made 19 of 20 once
OF_DIPS = 2.0 / 3.0


@dataclass(frozen=True)
class WrongSide:
    """The side that a base has, refuted.

    Args:
        outwards, inwards: how many bends and kinks of the trace are sharper than the ball, to either side of the base.
        chance: of so many outwards, at most, if all of them were outliers.
        lifts: how many times the finger was lifted to the side that the body was taken to lie on.
        turned: True if the base was turned over, and what is told rests on the side that the trace speaks for.
    """

    outwards: int
    inwards: int
    chance: float
    lifts: int = 0
    turned: bool = False

    def record(self) -> dict[str, Any]:
        """JSON values."""
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What the trace says, for people."""
        if self.lifts:
            times = "once" if self.lifts == 1 else f"{self.lifts} times"
            return f"the finger was lifted {times} to where the body would be"
        return (
            f"at {self.outwards} places the path bends away from the body more sharply than the ball, as a ball's path "
            f"does only towards it ({self.inwards} places)"
        )


def wrong_side(laid: LaidTrace) -> WrongSide | None:
    """Hold the side of a base against the kinks of what was felt on it.

    Args:
        laid: the trace, outliers included.

    Returns:
        What refutes it; None if nothing does.
    """
    from scipy.special import bdtrc

    outwards = sharp_bends(laid, 1.0)
    if OF_DIPS**outwards > REFUTED_BY_CHANCE:
        return None
    inwards = sharp_bends(laid, -1.0)
    chance = float(bdtrc(outwards - 1, outwards + inwards, OF_DIPS))
    return WrongSide(outwards, inwards, chance) if chance < REFUTED_BY_CHANCE else None
