"""Felt: what a finger returned of a move, held against the move and against what the finger says of itself."""

from __future__ import annotations

import numpy as np

from hw.finger import Workspace
from hw.move import Move
from mapping import Trace, length_text, lengths

# Noise takes samples out of the workspace that bounds the centre, but no sensor is worth reading that is off by more
# than this many tip radii: scenes refuse such noise (explore3d.scene, MOST_NOISE)
OUTSIDE_RADII = 10.0
# What a driver may have forgotten, and by how much its trace is longer then than the way it was sent
_FORGOTTEN = {
    "another frame than the object's (origin, axes)": 1.0,
    "positions in inches instead of metres": 1.0 / 25.4e-3,
    "positions in millimetres instead of metres": 1e3,
    "positions in micrometres instead of metres": 1e6,
}


def wrong_trace(move: Move, trace: Trace, workspace: Workspace) -> str | None:
    """What is wrong with a trace that a finger returned of a move, as a sentence; None if nothing is.

    Its times must not decrease within a sweep. Half of its samples at least must lie where the finger says that it
    can be: single ones may be spikes.
    """
    if back := trace.backwards():
        return (
            f"the times of what the finger returned of a {move.purpose} run backwards: {back}; "
            "possible: samples in the order of time, by one clock"
        )
    reach = OUTSIDE_RADII * trace.tip_radius
    outside = lengths(trace.centers - np.clip(trace.centers, workspace.low, workspace.high))
    if not len(trace) or np.median(outside) <= reach:
        return None
    low, high = (np.round(bound, 6).tolist() for bound in (workspace.low, workspace.high))
    where = np.round(trace.centers[int(outside.argmax())], 6).tolist()
    begin, end = (np.round(place, 6).tolist() for place in move.path[[0, -1]])
    return (
        f"what the finger returned of a {move.purpose} lies outside of its own workspace: asked for were centres "
        f"on the way from {begin} to {end} m; found {int((outside > reach).sum())} of {len(trace)} samples outside, "
        f"up to {length_text(float(outside.max()))}, as at {where} m; possible are {low} to {high} m. Likely cause: "
        f"{_cause(move, trace)}"
    )


def _cause(move: Move, trace: Trace) -> str:
    """What makes a trace so much longer than the way that it was felt on; across the way it may be of any depth."""
    size, way = (float(np.linalg.norm(np.ptp(each, axis=0))) for each in (trace.centers, move.path))
    if not (size > 0 and way > 0):
        return "another unit than metres, or another frame than the object's"
    return min(_FORGOTTEN, key=lambda name: abs(np.log(size / way / _FORGOTTEN[name])))
