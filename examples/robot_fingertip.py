"""A robot's fingertip explores a part: put in your robot's driver, take out features with intervals.

    python robot_fingertip.py [FOLDER]

`Arm` stands for your robot, which slides a ball over the part and says where the ball's centre was. `Fingertip` is all
that explore3d asks of a robot: its limits, and moves carried out. A scene says what is known: the part's mesh (a plate;
nobody told that a wire lies on it), the tip, and how low the lowest detail is.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import explore3d
from explore3d.scene import copy_example
from hw import Workspace
from mapping import Trace
from mapping.geometry.contact import BallContact


class Arm:
    """A robot that reports 500 places a second, to 50 um; it touches the part as the example's mesh shows it."""

    def __init__(self, part, radius):
        self.ball, self.random, self.clock = BallContact(part, radius), np.random.default_rng(1), 0.0

    def slide(self, path, approach, speed):
        """Press along the approach while moving along the path; times (s) and the ball's centres (m) in contact."""
        corners = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        along = np.arange(0.0, corners[-1], speed / 500.0)
        ways = [np.column_stack([np.interp(along, corners, each) for each in array.T]) for array in (path, approach)]
        rests = self.ball.press(*ways)
        felt = (rests.count > 0) & (np.abs(rests.distance) < 0.02)  # beyond the part's edge the finger hangs free
        times, self.clock = self.clock + along / speed, self.clock + corners[-1] / speed
        return times[felt], (rests.centers + self.random.normal(0.0, 50e-6, (len(along), 3)))[felt]


class Fingertip:
    """The robot as explore3d sees it: hw.Finger. Connect in __enter__, draw back in __exit__."""

    tip_radius, info = 10e-3, {"kind": "robot", "serial": "00042"}
    workspace = Workspace(np.full(3, -0.2), np.full(3, 0.2), max_speed=0.1, max_force=5.0)

    def __init__(self, arm):
        self.arm, self.sweeps = arm, 0

    def execute(self, move):
        times, centers = self.arm.slide(move.path, move.approach, move.speed)
        self.sweeps += move.purpose == "sweep"
        times = times if move.purpose == "sweep" else times[:0]  # on its way the finger touches nothing that counts
        return Trace(times, centers[: len(times)], np.full(len(times), self.sweeps), self.tip_radius)

    def __enter__(self):
        return self

    def __exit__(self, *error): ...


def main(folder):
    scene = explore3d.load_scene(copy_example("wire_on_plate", folder / "scene")[0])
    found = explore3d.run(scene, folder / "session", finger=Fingertip(Arm(scene.object_surface(), 10e-3)))
    words = "; ".join(f"{each.id}: {each.height} high, {each.length} long" for each in found.model)
    # every place that was felt, seen square to the plate, in the colour of its height over it
    feet = found.base.foot(found.trace.centers, found.trace.tip_radius)
    axes = plt.figure(figsize=(8.0, 5.0), layout="constrained").add_subplot(projection="3d", proj_type="ortho")
    dots = axes.scatter(*(1e3 * feet.points.T), c=1e3 * feet.height, s=0.5, vmin=-0.1, vmax=0.7)
    axes.view_init(elev=45.0, azim=-90.0)
    axes.set_box_aspect(np.ptp(feet.points, axis=0), zoom=1.6)
    axes.set_axis_off()
    axes.figure.suptitle(words, fontsize=10)
    axes.figure.colorbar(dots, label="height of the ball over its way on the bare plate (mm)", shrink=0.8)
    axes.figure.savefig(folder / "robot_fingertip.png", dpi=110)
    print(f"{words}\nreport: {folder / 'session' / 'report.html'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "robot_fingertip"))
