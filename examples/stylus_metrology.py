"""A stylus runs over a ground, gently curved part: which scratches and burrs are there, and do they pass the drawing?

    python stylus_metrology.py [FOLDER]

The profile is made here as an instrument exports it (x and z in mm): an arc of 80 mm radius, ground to some nanometres,
with a scratch 4 um wide and two burrs, 0.5 and 0.15 um high. Put your own file in its place; `explore3d inspect` says
how it is read. Sizes are those of the part: what the stylus' ball adds to a burr and cannot reach of a scratch is told.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import explore3d
from mapping.model import Tolerance

STYLUS, STEP = 5e-6, 0.25e-6  # radius of the stylus, and distance of samples (m)
SCRATCH, BURRS = (1.1e-3, 2e-6), ((2.0e-3, 0.5e-6, 4e-6), (3.0e-3, 0.15e-6, 4e-6))  # place, height, half-width (m)
DRAWING = Tolerance("bump", "height", limit=0.3e-6), Tolerance("pit", "width", limit=6e-6)


def profile():
    """x and z of the ball's centre: the part, dilated by the ball, and what the instrument adds."""
    x, random = np.arange(0.0, 4e-3, STEP), np.random.default_rng(7)
    ground = np.convolve(random.normal(0.0, 1.0, len(x)), np.hanning(160), mode="same")
    part = x * (x[-1] - x) / (2.0 * 80e-3) + 8e-9 * ground / ground.std()
    part[np.abs(x - SCRATCH[0]) < SCRATCH[1]] -= 3e-6
    for place, height, half in BURRS:
        part += height * np.maximum(0.0, 1.0 - ((x - place) / half) ** 2)
    reach = np.arange(-20, 21)
    ball = np.sqrt(np.maximum(STYLUS**2 - (STEP * reach) ** 2, 0.0))
    under = np.lib.stride_tricks.sliding_window_view(np.pad(part, 20, mode="edge"), len(reach))
    return x, (under + ball).max(axis=1) + random.normal(0.0, 3e-9, len(x))


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    file, rows = folder / "profile.csv", 1e3 * np.column_stack(profile())
    np.savetxt(file, rows, "%.7f", ",", header="x [mm],z [mm]", comments="")
    found = explore3d.analyze(file, folder / "session", tip_radius=STYLUS, units="mm")
    feet = found.base.foot(found.trace.centers, STYLUS)
    figure, (upper, lower) = plt.subplots(2, figsize=(8.5, 5.5), layout="constrained", sharex=True)
    upper.plot(1e3 * found.trace.centers[:, 0], 1e6 * found.trace.centers[:, 2], color="#829ab1")
    upper.set(ylabel="height (um)", title="as recorded")
    lower.plot(1e3 * found.trace.centers[:, 0], 1e6 * feet.height, color="#829ab1", linewidth=0.7)
    lower.set(xlabel="place (mm)", ylabel="height over the form (um)", title="without its form, and what was found")
    for each in found.model:
        place, size = 1e3 * each.axis[0, 0], each.height if each.kind == "bump" else each.width
        chances = [tolerance.probability(size) for tolerance in DRAWING if tolerance.kind == each.kind]
        words = f"{each.id}: {'high' if each.kind == 'bump' else 'wide'} {size}"
        print(f"{words}, at {place:.4f} mm; within the drawing with probability {chances[0]:.2f}")
        over = 12 if each.kind == "bump" else -16
        lower.annotate(words, (place, 1e6 * each.height.median), (0, over), textcoords="offset points", ha="center")
    lower.margins(y=0.25)
    figure.savefig(folder / "stylus_metrology.png", dpi=110)
    if found.roughness is not None:
        print(f"beside them: Ra {found.roughness.profile['Ra']}, Rz {found.roughness.profile['Rz']}")
    print(f"report: {folder / 'session' / 'report.html'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "stylus_metrology"))
