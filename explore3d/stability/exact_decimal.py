"""Formulas in decimal arithmetic of 60 digits: the reference of the stability table, and condition numbers from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Decimal, getcontext, localcontext

DIGITS = 60
DIFFERENCE_STEP = Decimal(10) ** -20  # relative, for differences: leaves 20 digits of a derivative

Formula = Callable[..., Decimal]


def exact(formula: Formula, arguments: Sequence[float]) -> Decimal:
    """The formula of these very floats, to far more digits than a float has."""
    with localcontext() as context:
        context.prec = DIGITS
        return formula(*(Decimal(each) for each in arguments))


def condition(formula: Formula, arguments: Sequence[float]) -> float:
    """Relative condition number: the sum over the arguments of |x df/dx| / |f|; at least 1."""
    with localcontext() as context:
        context.prec = DIGITS
        given = [Decimal(each) for each in arguments]
        value = formula(*given)
        total = Decimal(0)
        for k, each in enumerate(given):
            moved = [*given[:k], each * (1 + DIFFERENCE_STEP), *given[k + 1 :]]
            total += abs((formula(*moved) - value) / DIFFERENCE_STEP)
        return 1.0 if value == 0 else max(1.0, float(total / abs(value)))


def relative_error(found: float, true: Decimal) -> float:
    """|found - true| / |true|, or |found| where the truth is 0."""
    with localcontext() as context:
        context.prec = DIGITS
        gap = abs(Decimal(found) - true)
        return float(gap / abs(true)) if true else float(gap)


def arctan(x: Decimal) -> Decimal:
    """Arc tangent by halving the angle and Taylor's series."""
    halvings = 0
    while abs(x) > Decimal("0.05"):
        x = x / (1 + (1 + x * x).sqrt())
        halvings += 1
    term, total, n = x, x, 1
    while abs(term) > abs(total) * Decimal(10) ** -(getcontext().prec + 2):
        term *= -x * x
        n += 2
        total += term / n
    return total * Decimal(2**halvings)
