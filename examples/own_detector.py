"""A detector of your own beside ours, on exact contact: who finds how low a crest, at the same rate of false alarms?

    python own_detector.py [FOLDER]

A ball of 10 mm slides over a plate with a sharp crest across its way; `BallContact` gives its centre to the last digit,
and noise is added as a robot has it: white, and correlated over 1 mm. `mine` stands for your detector: it is given a
sweep and says how sure it is of a crest. Its threshold is set on bare plates; ours is told the rate of false alarms.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import lfilter

from mapping import Surface, Trace, detect
from mapping.base import Base
from mapping.geometry.contact import BallContact

RADIUS, LENGTH, STEP = 10e-3, 0.1, 50e-6  # of the ball, of a sweep, between samples (m)
WHITE, CORRELATED, OVER = 50e-6, 20e-6, 1e-3  # noise, and the length over which the second is correlated (m)
ALARMS = 0.05  # false alarms a sweep
BARE, SWEEPS = 1000, 200  # sweeps over a bare plate, and over each crest
HEIGHTS = 1e-6 * np.array([0.0, 50.0, 75.0, 100.0, 125.0])
PLATE = Base(Surface(0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]]))


def plate_with_crest(height):
    """The plate with a ridge along y, its section a triangle."""
    ridge = [[x * height, y, z * height] for y in (-0.05, 0.05) for x, z in ((-1, 0), (0, 1), (1, 0))]
    faces = [[4, 5, 8], [4, 8, 7], [5, 6, 9], [5, 9, 8]]
    return Surface(np.vstack([PLATE.surface.vertices, ridge]), np.vstack([PLATE.surface.faces, faces]))


def sweep(ball, random, number=0):
    """One sweep across the crest, as it is felt."""
    x = np.arange(-LENGTH / 2, LENGTH / 2, STEP) + random.uniform(0.0, STEP)
    above = np.column_stack([x, np.zeros(len(x)), np.full(len(x), 3.0 * RADIUS)])
    centers = ball.first_contact(above, (0.0, 0.0, -1.0)).centers.copy()
    keep, (kicks, white) = np.exp(-STEP / OVER), random.normal(0.0, 1.0, (2, len(x)))
    centers[:, 2] += CORRELATED * np.sqrt(1.0 - keep**2) * lfilter([1.0], [1.0, -keep], kicks) + WHITE * white
    return Trace(number * 10.0 + STEP / 0.03 * np.arange(len(x)), centers, np.full(len(x), number), RADIUS)


def mine(trace):
    """The largest mean height over 3 mm, in the scatter of such means."""
    height = PLATE.foot(trace.centers, RADIUS).height
    means = np.convolve(height, np.ones(60) / 60, mode="valid")
    means -= np.median(means)
    return means.max() / np.median(np.abs(means))


def ours(trace):
    """Numbers of the sweeps in which there is something."""
    return {each.sweep for each in detect(trace, PLATE, false_alarms_per_metre=ALARMS / LENGTH).crossings}


def main(folder):
    random, found = np.random.default_rng(5), []
    bare = BallContact(PLATE.surface, RADIUS)
    threshold = np.quantile([mine(sweep(bare, random)) for _ in range(BARE)], 1.0 - ALARMS)
    for height in HEIGHTS:
        ball = BallContact(plate_with_crest(height), RADIUS) if height else bare
        felt = [sweep(ball, random, number) for number in range(SWEEPS)]
        by_ours, by_mine = ours(Trace.concatenate(felt)), [each for each in felt if mine(each) > threshold]
        found.append([len(by_ours) / SWEEPS, len(by_mine) / SWEEPS])
        print("crest of {:3.0f} um: ours finds {:4.0%}, mine {:4.0%}".format(1e6 * height, *found[-1]))
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    for name, shares, style in zip(("ours", "mine: mean over 3 mm"), np.transpose(found), ("o-", "s--"), strict=True):
        axes.plot(1e6 * HEIGHTS, 100.0 * shares, style, label=name)
    axes.set(xlabel="height of the crest (um)", ylabel="sweeps that find it (%)", ylim=(-3, 103))
    axes.legend(title=f"{ALARMS:.0%} of bare sweeps may alarm; {SWEEPS} sweeps a point")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "own_detector.png", dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
