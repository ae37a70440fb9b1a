"""Surface account: what lies off the base of a body without a mesh is said first."""

from __future__ import annotations

import numpy as np

from explore3d.analysis import SurfaceAccount, unmodelled_share
from mapping import Surface, Trace
from mapping.base import Base

TIP = 3e-3


def felt(*levels: float) -> Trace:
    """A line of 60 mm at each level over a plate of 60 mm by 40 mm, m."""
    x = np.linspace(-30e-3, 30e-3, 400)
    lines = [np.column_stack([x, np.full(400, 2e-3 * k), np.full(400, TIP + z)]) for k, z in enumerate(levels)]
    sweep = np.repeat(np.arange(len(levels)), 400)
    return Trace(np.arange(float(len(sweep))), np.concatenate(lines), sweep, TIP)


def plate() -> Base:
    corners = [[-30e-3, -20e-3, 0.0], [30e-3, -20e-3, 0.0], [30e-3, 20e-3, 0.0], [-30e-3, 20e-3, 0.0]]
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]), "plane")


def test_what_was_felt_far_below_the_base_is_not_modelled() -> None:
    """However often the base itself is swept."""
    assert unmodelled_share(felt(0.0, 0.0, 0.5e-3, -2e-3), plate()) == 0.0, "details, and a ball that rolls off an edge"
    share = unmodelled_share(felt(*[0.0] * 12, -20e-3), plate())
    assert share > 0.1


def test_a_body_that_is_not_modelled_is_said_first() -> None:
    swept = {"area": 1e-3, "swept": 1.0, "refused": 0.0, "unreachable": 0.0, "not_inspected": 0.0, "reach": 1e-3}
    paths = {"swept_path": 1.0, "other_path": 0.0, "refused_path": 0.0, "moves": 10, "causes": ()}
    account = SurfaceAccount(**swept, **paths, unmodelled=0.32, base_kind="plane")
    assert account.short, "the exit status is 3"
    assert account.warning().startswith("NOT INSPECTED: 32 % of the body") and "off the plane" in account.warning()
    assert account.record()["unmodelled"] == 0.32
    assert not SurfaceAccount(**swept, **paths, unmodelled=0.02, base_kind="plane").short
