"""A touch probe on a CNC machine: probe a grid with your own sender, then ask what is on the part.

    python cnc_probe.py [FOLDER]

Writes probe.nc, a program of G38.2 probings for Grbl, grblHAL or LinuxCNC. Run it with your sender and keep what the
machine answers, [PRB:x,y,z:1] line by line. `answers` stands for the machine here: it touches a tile of 60 mm by 40 mm
on which a wire of 0.65 mm lies askew. Nothing is told of the part: its plane is fitted to the touches. (explore3d can
drive a Grbl machine itself, and follow what it finds: `explore3d init --finger grbl`, docs/hardware.md.)
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import explore3d
from explore3d.scene import example
from mapping.geometry.contact import BallContact

BALL = 3e-3  # radius of the probe's ball, m
ROW, STEP, SAFE = 2.0, 0.4, 8.0  # mm between rows, between touches, and the height to travel at


def grid():
    """Places to probe, mm: rows along y, to and fro."""
    along = np.arange(-18.0, 18.0 + STEP, STEP)
    rows = np.arange(-28.0, 28.0 + ROW, ROW)
    return [(x, y) for number, x in enumerate(rows) for y in (along if number % 2 == 0 else along[::-1])]


def program():
    """G-code: over each place, down until the probe touches, up again."""
    touches = [f"G0 X{x:.3f} Y{y:.3f}\nG38.2 Z-2 F120\nG0 Z{SAFE:g}" for x, y in grid()]
    return "\n".join(["G21 G90", f"G0 Z{SAFE:g}", *touches, ""])


def answers():
    """What a machine with a repeatability of 5 um answers, mm; the ball's centre is what it calls its tool."""
    part = explore3d.load_scene(example("unknown_plate").scene).object_surface()
    above = np.array([(1e-3 * x, 1e-3 * y, 1e-3 * SAFE) for x, y in grid()])
    rests = BallContact(part, BALL).first_contact(above, (0.0, 0.0, -1.0))
    touched = 1e3 * rests.centers + np.random.default_rng(3).normal(0.0, [0.0, 0.0, 5e-3], above.shape)
    return "\n".join(["ok\n[PRB:{:.3f},{:.3f},{:.3f}:1]".format(*each) for each in touched])


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "probe.nc").write_text(program())
    (folder / "probe.log").write_text(answers())
    found = explore3d.analyze(folder / "probe.log", folder / "session", tip_radius=BALL, units="mm")
    for each in found.model:
        ends = " to ".join(f"({1e3 * x:.2f}, {1e3 * y:.2f})" for x, y, _ in each.axis[[0, -1]])
        print(f"{each.id}: {each.height} high, {each.length} long, from {ends} mm")
    feet = found.base.foot(found.trace.centers, BALL)
    figure, axes = plt.subplots(figsize=(8.0, 4.8), layout="constrained")
    dots = axes.scatter(*(1e3 * feet.points[:, :2].T), c=1e3 * feet.height, s=5)
    for each in found.model:
        axes.plot(*(1e3 * each.axis[:, :2].T), "-", color="#c62828", label=f"{each.id}, {each.height} high")
    axes.set(
        xlabel="x (mm)", ylabel="y (mm)", aspect="equal", title="2,639 touches of a probe, and what is on the part"
    )
    axes.legend(loc="lower right")
    figure.colorbar(dots, label="height of the ball over the plane (mm)")
    figure.savefig(folder / "cnc_probe.png", dpi=110)
    print(f"report: {folder / 'session' / 'report.html'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "cnc_probe"))
