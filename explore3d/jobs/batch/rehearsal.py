"""Rehearsal: small tables analysed for the sake of what that loads and compiles."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from explore3d.jobs import analyze


def rehearse(*, quick: bool) -> None:
    """Analyse a small profile with a crest and an empty raster, and throw away what comes of them.

    Args:
        quick: as analyze; False also draws their reports.
    """
    rng, radius = np.random.default_rng(0), 1e-3
    x = np.linspace(-0.01, 0.01, 400)
    crest, noise = np.maximum(0.0, 50e-6 - x**2 / (2.0 * radius)), 1e-6 * rng.standard_normal((5, len(x)))
    profile = np.column_stack([x, radius + crest + noise[0]])
    across = enumerate(np.linspace(-2e-3, 2e-3, len(noise)))
    raster = np.concatenate([np.column_stack([x, np.full_like(x, y), radius + noise[k]]) for k, y in across])
    with tempfile.TemporaryDirectory(prefix="explore3d-") as folder:
        for name, table in (("profile", profile), ("raster", raster)):
            header = "x [m],z [m]" if table.shape[1] == 2 else "x [m],y [m],z [m]"
            path = Path(folder) / f"{name}.csv"
            np.savetxt(path, table, delimiter=",", header=header, comments="")
            analyze([path], None if quick else Path(folder) / name, tip_radius=radius, quick=quick)
