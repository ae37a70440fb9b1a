"""Sound: a sweep without the stretches that would run into another part of the body, its approach turned if need be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from hw import Move
from mapping import BoolArray, FloatArray, IntArray, lengths
from mapping.base import Base
from mapping.geometry.contact import BallContact
from planners.paths.carrier import FREE_SINKING, Carrier
from planners.paths.felt_details import DETAIL_ROOM
from planners.paths.pressed_path import PRESS

# The sensor's field about its axis (paper, section 4)
FIELD = float(np.radians(75.0))
# An approach is turned at most so far from the normal: over a wire a sixth of the tip's radius high the contact leaves
# the base's normal by arccos(1 - 1/6) = 34 degrees, and must stay in the field of 75
MOST_TURNED = float(np.radians(41.0))
# How far the base may hold a ball up from a sweep's commanded path, in tip radii: round a sharp edge of 90 degrees,
# whose corner the path cuts, it is 1 - cos(45 degrees) = 0.29, and the press 0.02; more is a wall
PRESSED = 0.5
# What a ball is to ride on may be so far off the approach: the field, less what the facets of a round body turn by
RIDDEN = float(np.radians(65.0))
# Room between the ball and a wall beside its way, in tip radii: poses and meshes are not better known
WALL_ROOM = 0.03
# Waypoints are looked at so close together, and stretches shorter than that are not worth a sweep, in tip radii
SOUND_SPACING, SHORTEST_PART = 0.2, 0.3
# How far a finger backs off before it goes elsewhere, in tip radii (hw.probing.grbl_finger does the same)
BACK_OFF_DISTANCE = 0.5
# Of a sweep that ran into something so much about that is left out, and shorter parts are not worth a sweep, in tip
# radii: a detail a sixth of a radius high lifts the ball as far as 0.58 of one beside it, and nobody knows its extent
BESIDE_WALL, LEAST_BESIDE = 1.0, 2.0
# About a sweep's ends the approach may be turned so that the finger can draw back, over so much, in tip radii
LEAVING_STRETCH = 1.0
# Lifted so far the ball has left what it is pressed against (its press is 0.02) but for that room, in tip radii
LIFTED_PATH = 0.02 + WALL_ROOM


def sound_parts(move: Move, carrier: Carrier) -> list[Move]:
    """The stretches of a sweep that ball and stem can make, in their order; the sweep itself if all of it is sound.

    At its ends the finger must be able to draw back, and beside what is not known yet where there is room: in a fold it
    is drawn back from one wall towards the other.

    Args:
        move: a sweep.
        carrier: the stem, and the body that it and the ball must stay out of.
    """
    if len(move.path) < 2:
        return [move] if ball_is_sound(move.path, move.approach, carrier.base, carrier.tip_radius).all() else []
    path, approach = resampled(move.path, move.approach, SOUND_SPACING * carrier.tip_radius)
    free = ball_is_sound(path, approach, carrier.base, carrier.tip_radius)
    tip = carrier.tip_radius
    roomy = replace(carrier, radius=carrier.radius + DETAIL_ROOM * tip, backing_room=DETAIL_ROOM * tip)
    if (free & roomy.is_free(path, approach)).all() and can_be_left(move, roomy):
        return [move]
    for each in (roomy, carrier):
        for run in runs(free):
            approach[run] = each.turned(path[run], approach[run], MOST_TURNED)
    free &= carrier.is_free(path, approach)
    stretches = (part for run in runs(free) for part in _left(path[run], approach[run], roomy, carrier))
    parts = (replace(move, path=part[0], approach=part[1]) for part in stretches if len(part[0]) > 1)
    return [part for part in parts if part.length >= SHORTEST_PART * tip]


def beside(move: Move, place: FloatArray, carrier: Carrier) -> list[Move]:
    """What is left of a sweep that ran into something with the ball's centre at a place (3,), m: up to it, and on.

    None of a sweep that does not lead there, so that it is not tried again, and none of what is too short to tell.
    """
    tip = carrier.tip_radius
    path, approach = resampled(move.path, move.approach, SOUND_SPACING * tip)
    off = np.linalg.norm(path - place, axis=1) > BESIDE_WALL * tip
    if move.purpose != "sweep" or off.all():
        return []
    parts = (replace(move, path=path[run], approach=approach[run]) for run in runs(off) if len(run) > 1)
    return [each for part in parts if part.length >= LEAST_BESIDE * tip for each in sound_parts(part, carrier)]


def resting_at_its_ends(move: Move, carrier: Carrier) -> Move:
    """A sweep whose ends are commanded to where the model holds the ball up; itself if it is not held up there,
    or if it could not be left from there or would lean on another wall than it is pressed against.

    In an inner corner a path that is pressed against one wall may run up to half a radius beneath where the other lets
    the ball come. What it feels is the same; but from there a finger backs off, and comes to there.
    """
    ends = np.array([0, -1])
    held = held_up(move.path[ends], move.approach[ends], carrier.base, carrier.tip_radius)
    lift = held - PRESS * carrier.tip_radius
    if (lift <= WALL_ROOM * carrier.tip_radius).all() or (held > PRESSED * carrier.tip_radius).any():
        return move  # it rests there already, or what holds it up is a wall
    path = move.path.copy()
    path[ends] -= np.maximum(lift, 0.0)[:, None] * move.approach[ends]
    raised = replace(move, path=path)
    normals = carrier.base.foot(path[ends], carrier.tip_radius).normals
    in_field = -np.einsum("ij,ij->i", normals, move.approach[ends]) >= np.cos(FIELD)
    return raised if in_field.all() and can_be_left(raised, carrier) else move


def can_be_left(move: Move, carrier: Carrier) -> bool:
    """True if the finger can draw back where a sweep ends, and had room to come to where it begins."""
    leaving = replace(carrier, backing=BACK_OFF_DISTANCE * carrier.tip_radius)
    ends = np.array([0, -1])
    return bool(leaving.is_free(move.path[ends], move.approach[ends]).all())


def _left(
    path: FloatArray, approach: FloatArray, roomy: Carrier, carrier: Carrier
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """A stretch's parts between waypoints from which the finger can draw back, turned there if need be.

    Args:
        path, approach: (K, 3) of a stretch that is sound.
        roomy: the stem with room for what is not known yet; given up where there is none.
        carrier: the stem.
    """
    near, number = int(np.ceil(LEAVING_STRETCH / SOUND_SPACING)), np.arange(len(path))
    backing = BACK_OFF_DISTANCE * carrier.tip_radius
    leaving = replace(carrier, backing=backing)
    for each in (replace(roomy, backing=backing), leaving):
        can = each.is_free(path[[0, -1]], approach[[0, -1]])
        may = ((number < near) & ~can[0]) | ((number >= len(path) - near) & ~can[-1])
        if may.any():
            turned = each.turned(path, approach, MOST_TURNED, may)
            if each is leaving or ball_is_sound(path, turned, carrier.base, carrier.tip_radius).all():
                approach = turned
    can = leaving.is_free(path, approach)
    # what is turned may no longer be pressed against what it was
    turning = 0.5 * (approach[1:] + approach[:-1])
    turning /= np.linalg.norm(turning, axis=1, keepdims=True)
    stem = replace(leaving, backing=0.0).clearance(0.5 * (path[1:] + path[:-1]), turning)
    between = np.flatnonzero(stem < -FREE_SINKING * leaving.tip_radius)
    for run in runs(ball_is_sound(path, approach, leaving.base, leaving.tip_radius)):
        # nor may the stem touch while it turns from one waypoint to the next
        for part in np.split(run, np.searchsorted(run, between[(between >= run[0]) & (between < run[-1])]) + 1):
            inner = part[can[part]]
            if len(inner):
                yield path[inner[0] : inner[-1] + 1], approach[inner[0] : inner[-1] + 1]


def ball_is_sound(path: FloatArray, approach: FloatArray, base: Base, tip_radius: float) -> BoolArray:
    """(K,) True where a pressed ball would rest on what it is pressed against, and not be stopped by a wall.

    The ball is lifted off by a little more than its press: if something is nearer then that is not within the
    sensor's field about the approach, it is a wall beside the way.

    Args:
        path: (K, 3) commanded centres, m.
        approach: (K, 3) unit directions of pressing.
    """
    deep = base.foot(path, tip_radius)
    feet = base.foot(path - LIFTED_PATH * tip_radius * approach, tip_radius)
    against = -np.einsum("ij,ij->i", feet.normals, approach)
    outward = deep.normals * np.where(deep.height > -tip_radius, 1.0, -1.0)[:, None]
    against = np.minimum(against, -np.einsum("ij,ij->i", outward, approach))
    sound = (feet.height > -tip_radius) & (against >= np.cos(RIDDEN))
    return np.asarray(sound & (held_up(path, approach, base, tip_radius) <= PRESSED * tip_radius))


def held_up(path: FloatArray, approach: FloatArray, base: Base, tip_radius: float) -> FloatArray:
    """(K,) how far balls rest above commanded centres (K, 3), back along the approach (K, 3), m; 0 where they are free.

    Exact contact with the base: a ball that sinks a little into a steep wall, or into a fold that narrows, is held up
    far, though the nearest place of the body alone would not tell.
    """
    felt = _contact(base, tip_radius).press(path, approach)
    return np.asarray(np.where(felt.count > 0, np.maximum(-felt.distance, 0.0), 0.0))


@lru_cache(maxsize=4)
def _contact(base: Base, tip_radius: float) -> BallContact:
    return BallContact(base.surface, tip_radius)


def resampled(path: FloatArray, approach: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """The polyline (K, 3) and its unit approaches (K, 3) with waypoints put between, at most `spacing` m apart."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    count = np.maximum(1, np.ceil(steps / spacing - 1e-9).astype(np.int64))
    leg = np.repeat(np.arange(len(steps)), count)
    place = leg + (np.arange(len(leg)) - (np.cumsum(count) - count)[leg]) / count[leg]
    place = np.append(place, float(len(steps)))
    number = np.arange(len(path))
    path, approach = (np.column_stack([np.interp(place, number, v[:, k]) for k in range(3)]) for v in (path, approach))
    length = lengths(approach)[:, None]
    return path, np.divide(approach, length, out=np.tile([0.0, 0.0, -1.0], (len(path), 1)), where=length > 0)


def runs(mask: BoolArray) -> list[IntArray]:
    """Stretches of consecutive True."""
    index = np.flatnonzero(mask)
    return np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(index) else []
