"""Heights over a fitted round body are those over the body, not over the facets that are drawn of it."""

import numpy as np
import pytest

from mapping.arrays import FloatArray
from mapping.base import fit_base
from mapping.trace import Trace

TIP = 3e-3


def _circles_of_latitude() -> list[FloatArray]:
    turn = np.linspace(0.0, 2.0 * np.pi, 800, endpoint=False)
    rows = []
    for rise in np.radians(np.arange(10.0, 60.0, 5.0)):
        way = np.column_stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.full(800, np.sin(rise))])
        rows.append((25e-3 + TIP) * way)
    return rows


def _rings_of_a_bore() -> list[FloatArray]:
    turn = np.linspace(0.0, 2.0 * np.pi, 800, endpoint=False)
    return [
        np.column_stack([(20e-3 - TIP) * np.cos(turn), (20e-3 - TIP) * np.sin(turn), np.full(800, 2e-3 * k)])
        for k in range(10)
    ]


def _rows_of_a_saddle() -> list[FloatArray]:
    x = np.linspace(-60e-3, 60e-3, 800)
    return [np.column_stack([x, np.full(800, y), x**2 / 0.2 - y**2 / 0.3]) for y in np.linspace(-56e-3, 56e-3, 15)]


@pytest.mark.parametrize(
    ("rows", "kind", "facets", "left"),
    [  # facets: the rms that a mesh of this family leaves, m; left: the share of it that may be left
        (_circles_of_latitude, "sphere", 0.34e-6, 0.1),
        (_rings_of_a_bore, "cylinder", 5.6e-9, 0.1),
        (_rows_of_a_saddle, "quadric", 0.79e-6, 0.1),
    ],
)
def test_facets_are_not_felt(rows: object, kind: str, facets: float, left: float) -> None:
    assert callable(rows)
    sweeps = rows()
    centers = np.concatenate(sweeps)
    sweep = np.repeat(np.arange(len(sweeps)), [len(each) for each in sweeps])
    base = fit_base(Trace(np.arange(float(len(centers))), centers, sweep, TIP))
    assert base.kind == kind
    feet = base.foot(centers, TIP)
    on_facets = base.nearest.query(centers).distance - TIP
    assert on_facets.std() > 0.5 * facets
    assert np.sqrt(np.mean(feet.height**2)) < left * facets
