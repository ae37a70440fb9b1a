"""Branches: the smooth lines of the skeleton graph of one connected detail, joined where lines meet.

Pieces of one line that the tree of its points left apart are joined again at their free ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.assembly.linking.spanning_tree import Tree, untied, way_from

ArmEnd = tuple[int, int]

# In half-widths of the disturbance: shorter twigs are scatter; meeting places nearer to each other are one; points so
# near to one belong to no arm alone; the stretch that tells an arm's direction.
TWIG, SAME_HUB, WITHIN_HUB, DIRECTION = 1.3, 2.0, 1.1, 3.5
# Cosine of the angle between two arms of one line that goes straight on through a junction.
STRAIGHT_ON = -0.85
# Cosine of the angle between both ways from a point at which a line has a corner; longest gap between arms that go
# straight on into each other, in half-widths.
CORNER, LONGEST_ARM_GAP = -0.64, 7.0


@dataclass(frozen=True, eq=False)
class Branch:
    """One smooth line.

    Args:
        axis: (K, 3) its points in order, m, with the meeting points at which it ends.
        free: for the first and the last point: True if the line ends there, False if it meets others.
        junction: True if other lines meet it.
        closed: True if it returns to its beginning (the first point is not repeated).
    """

    axis: FloatArray
    free: tuple[bool, bool]
    junction: bool
    closed: bool = False


@dataclass(frozen=True, eq=False)
class _Arm:
    """Points (K, 3) between two hubs; `hubs` numbers those at the first and the last point, -1 for none."""

    points: FloatArray
    hubs: tuple[int, int]

    def outward(self, end: int, hub: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
        """Mean point and unit direction away from the hub of the stretch next to an end."""
        points = self.points if end == 0 else self.points[::-1]
        near = points[np.linalg.norm(points - points[0], axis=1) <= reach]
        middle = near.mean(axis=0)
        away = middle - hub
        if len(near) > 2 or (len(near) == 2 and np.linalg.norm(near[1] - near[0]) > 0.3 * reach):
            direction = np.linalg.svd(near - middle, full_matrices=False)[2][0]
            away = direction * (1.0 if direction @ away > 0 else -1.0)
        return middle, away / max(float(np.linalg.norm(away)), np.finfo(float).tiny)


def branches(points: FloatArray, half_width: float, length: FloatArray | None = None) -> list[Branch]:
    """Lines through points (K, 3): the arms of their minimum spanning tree, joined straight on where they meet.

    Args:
        points: on the crests, m.
        half_width: of the disturbance, m.
        length: (K, K) length of the links between them, longer where one is less likely; None: their distances.
    """
    if length is None:
        length = np.linalg.norm(points[:, None] - points[None], axis=2)
    # once before twigs are cut, which may be all that shows that a line goes on past a tie, and once after it
    whole = [
        _without_twigs(part, points, TWIG * half_width) for part in untied(spanning_tree(length), points, half_width)
    ]
    parts = [part for tree in whole for part in untied(tree, points, half_width)]
    return [branch for part in parts for branch in _branches_of(part, points, half_width)]


def _branches_of(tree: Tree, points: FloatArray, half_width: float) -> list[Branch]:
    """The lines of one tree."""
    forks = [i for i, near in tree.items() if len(near) > 2 or _is_corner(i, tree, points, half_width)]
    if not forks:
        return [Branch(points[_path(tree)], (True, True), junction=False)]
    hubs = _clusters(forks, points, SAME_HUB * half_width)
    arms = _loosened(_arms(tree, points, hubs, WITHIN_HUB * half_width))
    meeting, partner, crowded = _meetings(arms, points, hubs, half_width)
    return _joined(arms, meeting, partner, crowded)


def main_line(points: FloatArray) -> FloatArray:
    """The points (K, 3) that lie on one line, without branches, in order."""
    length = np.linalg.norm(points[:, None] - points[None], axis=2)
    return points[_path(_without_twigs(spanning_tree(length), points, np.inf))]


def spanning_tree(length: FloatArray) -> Tree:
    """Neighbours of each point in the minimum spanning tree of links of given lengths (K, K), by Prim's algorithm."""
    count = len(length)
    tree: Tree = {i: set() for i in range(count)}
    nearest, best = np.zeros(count, dtype=int), length[0].copy()
    outside = np.ones(count, dtype=bool)
    outside[0] = False
    while outside.any():
        new = int(np.where(outside, best, np.inf).argmin())
        tree[new].add(int(nearest[new]))
        tree[int(nearest[new])].add(new)
        outside[new] = False
        nearest[length[new] < best], best = new, np.minimum(best, length[new])
    return tree


def _without_twigs(tree: Tree, points: FloatArray, shortest: float) -> Tree:
    """The tree less its dead ends that are too short, the shortest first."""
    tree = {i: set(near) for i, near in tree.items()}
    while True:
        twigs = [_twig(tree, leaf, points) for leaf, near in tree.items() if len(near) == 1]
        short = [twig for twig in twigs if twig is not None and twig[0] < shortest]
        if not short:
            return tree
        for i in min(short)[1]:
            for j in tree.pop(i):
                if j in tree:
                    tree[j].discard(i)


def _twig(tree: Tree, leaf: int, points: FloatArray) -> tuple[float, list[int]] | None:
    """Length from a leaf to the fork that it hangs on, and its points; None if there is no fork."""
    path, length = [leaf], 0.0
    before, here = leaf, next(iter(tree[leaf]))
    while True:
        length += float(np.linalg.norm(points[here] - points[before]))
        if len(tree[here]) > 2:
            return length, path
        if len(tree[here]) == 1:
            return None
        path.append(here)
        before, here = here, next(i for i in tree[here] if i != before)


def _path(tree: Tree) -> list[int]:
    """The points of a tree without forks, from end to end."""
    start = min(tree, key=lambda i: (len(tree[i]), i))
    path, before = [start], -1
    while ahead := [i for i in tree[path[-1]] if i != before]:
        before = path[-1]
        path.append(ahead[0])
    return path


def _clusters(forks: list[int], points: FloatArray, distance: float) -> list[list[int]]:
    """Forks that are nearer to each other than the distance, directly or through others."""
    clusters: list[list[int]] = []
    for fork in forks:
        near = [c for c in clusters if np.linalg.norm(points[c] - points[fork], axis=1).min() < distance]
        clusters = [c for c in clusters if c not in near] + [[fork, *(i for c in near for i in c)]]
    return clusters


def _arms(tree: Tree, points: FloatArray, hubs: list[list[int]], radius: float) -> list[_Arm]:
    """What is left of the tree outside of the hubs."""
    home = {}
    for i in tree:
        gaps = [float(np.linalg.norm(points[hub] - points[i], axis=1).min()) for hub in hubs]
        if min(gaps) < radius:
            home[i] = int(np.argmin(gaps))
    rest = {i: {j for j in near if j not in home} for i, near in tree.items() if i not in home}
    arms = []
    while rest:
        part, waiting = set(), [next(iter(rest))]
        while waiting:
            i = waiting.pop()
            part.add(i)
            waiting += [j for j in rest[i] if j not in part]
        path = _path({i: rest[i] for i in part})
        for i in part:
            del rest[i]
        at = [[home[j] for j in tree[i] if j in home] for i in (path[0], path[-1])]
        first = at[0][0] if at[0] else -1
        last = (at[1][1] if len(at[1]) > 1 else -1) if len(path) == 1 else at[1][0] if at[1] else -1
        length = float(np.linalg.norm(np.diff(points[path], axis=0), axis=1).sum())
        # what is short and hangs between two hubs is a part of the place where lines meet
        if first < 0 or last < 0 or length > radius:
            arms.append(_Arm(points[path], (first, last)))
    return arms


def _loosened(arms: list[_Arm]) -> list[_Arm]:
    """The arms with free ends where a hub has no other arm: nothing meets there."""
    at = [hub for arm in arms for hub in arm.hubs]

    def held(hub: int) -> int:
        return hub if at.count(hub) > 1 else -1

    return [_Arm(arm.points, (held(arm.hubs[0]), held(arm.hubs[1]))) for arm in arms]


def _is_corner(i: int, tree: Tree, points: FloatArray, half_width: float) -> bool:
    """True where the line through a point turns sharply: two lines met there and the tree took the wrong turn."""
    if len(tree[i]) != 2:
        return False
    ways = [way_from(i, first, tree, points, half_width) for first in tree[i]]
    return bool(ways[0] @ ways[1] > CORNER)


def _meetings(
    arms: list[_Arm], points: FloatArray, hubs: list[list[int]], half_width: float
) -> tuple[list[FloatArray], dict[ArmEnd, ArmEnd], set[int]]:
    """Where the arms of each hub meet, which arms go straight on into which, and the hubs where lines meet."""
    centers = [points[hub].mean(axis=0) for hub in hubs]
    ends = [(a, e) for a, arm in enumerate(arms) for e in (0, 1) if arm.hubs[e] >= 0]
    home = {(a, e): arms[a].hubs[e] for a, e in ends}
    seen = {(a, e): arms[a].outward(e, centers[home[a, e]], DIRECTION * half_width) for a, e in ends}
    partner: dict[ArmEnd, ArmEnd] = {}
    for _, one, other in sorted(_straight_pairs(arms, seen, LONGEST_ARM_GAP * half_width)):
        if one not in partner and other not in partner:
            partner[one], partner[other] = other, one
    meeting, crowded = [], set()
    for number, center in enumerate(centers):
        own = [end for end in ends if home[end] == number]
        if len(own) > 2 or any(end in partner and home[partner[end]] != number for end in own):
            crowded.add(number)
        elif len(own) == 2 and own[0] not in partner and own[1] not in partner:
            partner[own[0]], partner[own[1]] = own[1], own[0]
        meeting.append(nearest_to_lines([seen[end] for end in own], center, half_width))
    return meeting, partner, crowded


def _straight_pairs(
    arms: list[_Arm], seen: dict[ArmEnd, tuple[FloatArray, FloatArray]], longest: float
) -> list[tuple[float, ArmEnd, ArmEnd]]:
    """Pairs of arm ends that continue each other over the gap between them, with how far from straight they are."""
    pairs = []
    for one, (_, way) in seen.items():
        for other, (_, back) in seen.items():
            if one >= other or one[0] == other[0]:
                continue
            gap = arms[other[0]].points[-other[1]] - arms[one[0]].points[-one[1]]
            length = float(np.linalg.norm(gap))
            over = [-way @ gap / length, back @ gap / length] if length > 0 else [1.0, 1.0]
            straight = min(float(v) for v in (*over, -way @ back))
            if straight > -STRAIGHT_ON and length < longest:
                pairs.append((1.0 - straight, one, other))
    return pairs


def nearest_to_lines(lines: list[tuple[FloatArray, FloatArray]], center: FloatArray, half_width: float) -> FloatArray:
    """The point that is nearest to all lines (point, direction), held to the neighbourhood of the centre."""
    weak = 1e-3
    left, right = weak * np.eye(3), weak * center
    for point, way in lines:
        across = np.eye(3) - np.outer(way, way)
        left, right = left + across, right + across @ point
    shift = np.linalg.solve(left, right) - center
    return np.asarray(center + shift * min(1.0, 2.0 * half_width / max(float(np.linalg.norm(shift)), 1e-300)))


def _joined(
    arms: list[_Arm], meeting: list[FloatArray], partner: dict[ArmEnd, ArmEnd], crowded: set[int]
) -> list[Branch]:
    """Arms joined with their partners, from every end that has none; then the loops."""
    result: list[Branch] = []
    used: set[int] = set()
    begins = [(a, e) for a in range(len(arms)) for e in (0, 1) if (a, e) not in partner]
    for start in [*begins, *((a, 0) for a in range(len(arms)))]:
        if start[0] in used:
            continue
        pieces, junction, here = [], False, start
        while True:
            arm, end = here
            used.add(arm)
            pieces.append(arms[arm].points if end == 0 else arms[arm].points[::-1])
            junction |= any(hub in crowded for hub in arms[arm].hubs)
            here = partner.get((arm, 1 - end), (-1, -1))
            if here[0] < 0 or here[0] in used:
                break
        last = arms[arm].hubs[1 - end]
        closed = here == start
        first = -1 if start in partner else arms[start[0]].hubs[start[1]]
        last = -1 if (arm, 1 - end) in partner else last
        pieces = [
            *([meeting[first][None]] if first >= 0 else []),
            *pieces,
            *([meeting[last][None]] if last >= 0 else []),
        ]
        result.append(Branch(np.concatenate(pieces), (first < 0, last < 0), junction, closed))
    return result


FreeEnd = tuple[int, int]


def rejoined(lines: list[Branch], half_width: float, denied: Callable[[FloatArray, FloatArray], bool]) -> list[Branch]:
    """The lines, those of them joined that go straight on into each other over a gap without a lower place.

    Where two lines run side by side with few crossings, the way across to the other one may be shorter than the way on:
    the tree of all points then hangs a line on its neighbour in pieces. Such a piece may be a single point, which goes
    wherever a line leads to it.

    Args:
        lines: some of which end free.
        half_width: of the disturbance, m.
        denied: whether a place between two points (3,) felt no crest.
    """
    lines = list(lines)
    while (pair := _straightest(lines, half_width, denied)) is not None:
        whole = joined(lines, *pair)
        lines = [line for k, line in enumerate(lines) if k not in (pair[0][0], pair[1][0])] + [whole]
    return lines


def joined(lines: list[Branch], one: FreeEnd, other: FreeEnd) -> Branch:
    """Two of some lines as one, from an end of the first to one of the second: their numbers, and 0 or 1 for each."""
    first, second = _turned(lines[one[0]], 1 - one[1]), _turned(lines[other[0]], other[1])
    axis = np.concatenate([first.axis, second.axis])
    return Branch(axis, (first.free[0], second.free[1]), first.junction or second.junction)


def _turned(line: Branch, turn: int) -> Branch:
    """The line, backwards if `turn` is 1."""
    return Branch(line.axis[::-1], line.free[::-1], line.junction) if turn else line


def _straightest(
    lines: list[Branch], half_width: float, denied: Callable[[FloatArray, FloatArray], bool]
) -> tuple[FreeEnd, FreeEnd] | None:
    """The two free ends of different lines that continue each other best, if any do."""
    ends = [(k, e) for k, line in enumerate(lines) if not line.closed for e in (0, 1) if line.free[e]]
    way = {(k, e): _outward(lines[k].axis, e, DIRECTION * half_width) for k, e in ends if len(lines[k].axis) > 1}
    best, pair = -STRAIGHT_ON, None
    for one in ends:
        for other in ends:
            start, stop = (lines[k].axis[-e] for k, e in (one, other))
            length = float(np.linalg.norm(stop - start))
            if one[0] >= other[0] or not 0.0 < length < LONGEST_ARM_GAP * half_width:
                continue
            gap = (stop - start) / length
            turns = [float(sign * way[end] @ gap) for end, sign in ((one, 1), (other, -1)) if end in way]
            turns += [float(-way[one] @ way[other])] if len(turns) == 2 else []
            straight = min(turns, default=-1.0)
            if straight > best and not denied(start, stop):
                best, pair = straight, (one, other)
    return pair


def _outward(axis: FloatArray, end: int, reach: float) -> FloatArray:
    """Unit direction (3,) off an end of a line, over a stretch before it."""
    points = axis if end == 0 else axis[::-1]
    away = np.linalg.norm(points - points[0], axis=1)
    far = min(int(np.searchsorted(away, reach)), len(points) - 1)
    step = points[0] - points[max(far, 1)]
    return np.asarray(step / np.linalg.norm(step))
