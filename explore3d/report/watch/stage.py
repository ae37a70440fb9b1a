"""Stage: what the view shows in 3D: the base, the samples up to a moment, the fingertip, the features."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore3d.report import LEAST_FEATURE_SHARE, NOTICED_COLOUR, SWEEP_COLOUR, VIEW_BASE_COLOUR, lighter
from mapping import Feature, FloatArray, IntArray, Surface, Trace
from mapping.geometry.mesh import middle
from mapping.inference.kinds import kind_of
from mapping.model import drawn_at_least, feature_mesh

# Of samples closer together than this share of the object's size, a third of a pixel, only some are drawn
DRAWN_SPACING = 5e-4
# So many samples after one another, a hundredth of a second, make steps along the path that noise does not lengthen
STEP_SAMPLES = 50
# Drawn samples of one node of the view: a step through time sends at most two nodes again, 0.1 MB
NODE_SAMPLES = 5000
# Samples that there is room for at first, doubled where there are more: 33 minutes of a finger that reports 1000 a
# second. Memory that is not written to is not taken: room costs nothing, and making it larger copies all that is there
# (a third of the time that 1.4e6 samples took when it began at 250,000)
FIRST_ROOM = 2_000_000
# A sample is drawn this share of the object's size wide
SAMPLE_SHARE = 1.2e-3
# The view is placed anew when the samples reach so many times further than it was placed for
OUTGROWN = 2.0
# The object fills this many of the view's units, whose camera sees from 0.01 to 1000
VIEW_SIZE = 2.0
LAYERS_SHOWN = ("base", "samples", "features", "fingertip")
CHOSEN_COLOUR = (255, 194, 8)
# From where the object is seen first, as a direction from it
FIRST_EYE = np.array([0.55, -0.75, 0.55])
# Distance of the camera from the object, and from a feature that was chosen, in sizes of the object
OVERVIEW, CLOSE_UP = 1.5, 0.75
VIEW_FIELD = 0.8  # rad, the camera's vertical field of view


class Stage:
    """The 3D scene of a server, in its own units: the object's middle is the origin, its size VIEW_SIZE.

    Args:
        server: a viser.ViserServer.
        picked: told the id of a feature that was clicked.
    """

    def __init__(self, server: Any, picked: Callable[[str], None]) -> None:
        self.server, self.picked = server, picked
        self.tip_radius = 0.0
        self.features: dict[str, Feature] = {}
        self._base: Surface | None = None
        self._surface: Surface | None = None
        self._shown: list[int] = []
        self._nodes: dict[int, Any] = {}
        self._meshes: dict[str, Any] = {}
        self._sweeping: Any = None
        self._tip: Any = None
        server.scene.set_up_direction("+z")
        self._layers = {name: server.scene.add_frame(f"/{name}", show_axes=False) for name in LAYERS_SHOWN}
        self.clear()

    def clear(self) -> None:
        """Forget every sample: another log begins."""
        self.t: FloatArray = np.zeros(0)
        self._centers: FloatArray = np.zeros((0, 3))
        self._sweep: NDArray[np.int32] = np.zeros(0, dtype=np.int32)
        self._drawn: IntArray = np.zeros(0, dtype=np.int64)
        self._points: FloatArray = np.zeros((0, 3))  # of the drawn samples alone
        self.count = self.drawn = 0
        self._trace: Trace | None = None
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._origin, self._size = np.zeros(3), 0.0
        self._base_placed = False
        self._last = 0
        for node in self._nodes.values():
            node.visible = False
        self._shown = [0] * len(self._shown)
        self._chosen: str | None = None

    # what is known

    def add(
        self, points: Callable[[IntArray], FloatArray], centers: FloatArray, t: FloatArray, sweep: NDArray[np.integer]
    ) -> None:
        """Samples that follow those that are there.

        Args:
            points: gives the places of contact (K, 3), m, of the samples (K,) that are drawn, numbered within these.
            centers: (N, 3) of the ball, m.
            t: (N,) s.
            sweep: (N,) numbers of the sweeps.
        """
        if not len(centers):
            return
        needed = self.count + len(centers)
        if needed > len(self.t):
            room = max(needed, 2 * len(self.t), FIRST_ROOM)
            self.t, self._centers, self._sweep = (_grown(each, room) for each in (self.t, self._centers, self._sweep))
        place = slice(self.count, needed)
        # a clock that jumps back would leave samples that no moment shows
        earlier = self.t[self.count - 1] if self.count else -np.inf
        self.t[place] = np.maximum.accumulate(np.maximum(t, earlier))
        self._centers[place], self._sweep[place] = centers, sweep
        chosen = self._chosen_of(centers)
        self._draw_some(chosen + self.count, points(chosen))
        self.count = needed

    def _chosen_of(self, centers: FloatArray) -> IntArray:
        """Which of those samples are drawn."""
        steps = min(STEP_SAMPLES, max(1, len(centers) - 1))
        coarse = centers[::steps]
        self._reach(coarse)
        length = float(np.linalg.norm(np.diff(coarse, axis=0), axis=1).sum())
        every = max(1, int(DRAWN_SPACING * self._size * len(centers) / max(length, DRAWN_SPACING * self._size)))
        return np.arange(0, len(centers), every)

    def _reach(self, places: FloatArray) -> None:
        """Place the view anew where the finger went further than it was placed for."""
        self._low = np.minimum(self._low, places.min(axis=0))
        self._high = np.maximum(self._high, places.max(axis=0))
        if not self._base_placed and np.linalg.norm(self._high - self._low) > OUTGROWN * self._size:
            self._place(self._low, self._high)

    def _draw_some(self, chosen: IntArray, points: FloatArray) -> None:
        """Note samples that are drawn, by their numbers, and where they touched."""
        drawn = self.drawn + len(chosen)
        if drawn > len(self._drawn):
            room = max(drawn, 2 * len(self._drawn), FIRST_ROOM)
            self._drawn, self._points = _grown(self._drawn, room), _grown(self._points, room)
        self._drawn[self.drawn : drawn], self._points[self.drawn : drawn] = chosen, points
        self.drawn = drawn

    def take_back(self, count: int) -> None:
        """Forget the last samples: they come again."""
        self.count -= count
        self.drawn = self._drawn_at(self.count)
        for number in range(self.drawn // NODE_SAMPLES, len(self._shown)):
            self._shown[number] = -1

    def trace(self) -> Trace | None:
        """All samples, None if there are none."""
        if not self.count:
            return None
        if self._trace is None or len(self._trace) != self.count:
            whole = slice(0, self.count)
            self._trace = Trace(
                self.t[whole], self._centers[whole], self._sweep[whole].astype(np.int64), self.tip_radius
            )
        return self._trace

    def show_base(self, surface: Surface) -> None:
        """The global model of the body."""
        if self._base_placed and self._base is not None and np.array_equal(self._base.vertices, surface.vertices):
            return
        self._base, self._surface = surface, lighter(surface)
        self._base_placed = True
        self._place(*surface.bounds)

    def show_features(self, features: Sequence[Feature]) -> None:
        """Features of a model, in the place of those that were there."""
        for name in set(self.features) - {each.id for each in features}:
            self._meshes.pop(name).remove()
        self.features = {each.id: each for each in features}
        if self._size:
            for each in features:
                self._draw_feature(each)

    def choose(self, name: str | None) -> None:
        """Mark a feature, and look at it from outside; None marks none."""
        before, self._chosen = self._chosen, name
        for each in (before, name):
            if each in self._meshes:
                self._meshes[each].color = CHOSEN_COLOUR if each == name else _colour(self.features[each])

    def look_at(self, name: str | None) -> None:
        """Turn every camera to a feature, or to the whole."""
        if name is None:
            target, direction, far = np.zeros(3), FIRST_EYE, OVERVIEW
        else:
            feature = self.features[name]
            place = middle(feature.axis)[0]
            normal = feature.normals[np.linalg.norm(feature.axis - place, axis=1).argmin()]
            # a little from the side: relief shows then, and a camera straight above does not know where up is
            aside = np.cross(normal, [0.31, 0.17, 0.93])
            target = self._view(place)
            direction, far = normal + 0.35 * aside, CLOSE_UP
        eye = target + far * VIEW_SIZE * direction / np.linalg.norm(direction)
        for client in self.server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at = eye, target

    # what is shown

    def show_until(self, count: int) -> None:
        """The first `count` samples, those of the sweep under way in their own colour, and the tip at the last one."""
        if not self._size:
            return
        drawn = self._drawn_at(count)
        with self.server.atomic():
            for number in range(max(len(self._shown), -(-drawn // NODE_SAMPLES))):
                wanted = min(max(drawn - number * NODE_SAMPLES, 0), NODE_SAMPLES)
                if number == len(self._shown):
                    self._shown.append(0)
                if wanted != self._shown[number]:
                    self._draw_samples(number, wanted)
            self._draw_tip(count, drawn)
            self._last = count

    def show_layer(self, name: str, visible: bool) -> None:
        """Show or hide one of LAYERS_SHOWN."""
        self._layers[name].visible = visible

    def count_at(self, t: float) -> int:
        """How many samples there were at a time, s."""
        return int(np.searchsorted(self.t[: self.count], t, side="right"))

    def _drawn_at(self, count: int) -> int:
        """How many of the first `count` samples are drawn."""
        return int(np.searchsorted(self._drawn[: self.drawn], count))

    def _place(self, low: FloatArray, high: FloatArray) -> None:
        """Choose origin and scale, and send everything again in them."""
        self._origin, self._size = 0.5 * (low + high), float(np.linalg.norm(high - low)) or 1.0
        eye = OVERVIEW * VIEW_SIZE * FIRST_EYE / np.linalg.norm(FIRST_EYE)
        self.server.initial_camera.position, self.server.initial_camera.look_at = tuple(eye), (0.0, 0.0, 0.0)
        self.server.initial_camera.fov = VIEW_FIELD
        self.look_at(None)
        with self.server.atomic():
            if self._surface is not None:
                vertices = self._view(self._surface.vertices).astype(np.float32)
                colour = tuple(round(255 * each) for each in VIEW_BASE_COLOUR)
                self.server.scene.add_mesh_simple(
                    "/base/mesh", vertices, self._surface.faces, color=colour, flat_shading=True, side="double",
                    cast_shadow=False, receive_shadow=False,
                )  # fmt: skip
            for feature in self.features.values():
                self._draw_feature(feature)
        self._shown = [-1] * len(self._shown)
        self.show_until(self._last)

    def _view(self, points: FloatArray) -> FloatArray:
        return np.asarray((points - self._origin) * (VIEW_SIZE / self._size))

    def _draw_samples(self, number: int, wanted: int) -> None:
        first = number * NODE_SAMPLES
        self._shown[number] = wanted
        if wanted == 0:
            if number in self._nodes:
                self._nodes[number].visible = False
            return
        points = self._view(self._points[first : first + wanted]).astype(np.float32)
        if number in self._nodes:
            self._nodes[number].points = points
            self._nodes[number].visible = True
        else:
            self._nodes[number] = self._cloud(f"/samples/{number}", points, SWEEP_COLOUR, SAMPLE_SHARE)

    def _cloud(self, name: str, points: NDArray[np.float32], colour: Sequence[float], share: float) -> Any:
        return self.server.scene.add_point_cloud(
            name, points, tuple(round(255 * each) for each in colour), point_size=share * VIEW_SIZE,
            point_shape="circle", point_shading="flat", precision="float32",
        )  # fmt: skip

    def _draw_tip(self, count: int, drawn: int) -> None:
        """The fingertip at the last sample that is shown, and the sweep that it is on."""
        if count == 0:
            return
        first = max(0, drawn - NODE_SAMPLES)
        others = np.flatnonzero(self._sweep[self._drawn[first:drawn]] != self._sweep[count - 1])
        points = self._view(self._points[first + (others[-1] + 1 if len(others) else 0) : drawn]).astype(np.float32)
        place = self._view(self._centers[count - 1])
        if self._sweeping is None:
            self._sweeping = self._cloud("/samples/sweep", points, NOTICED_COLOUR, 1.6 * SAMPLE_SHARE)
            self._tip = self.server.scene.add_icosphere(
                "/fingertip/ball", self._tip_size(), color=(237, 140, 33), opacity=0.45, position=place,
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
        else:
            self._sweeping.points, self._tip.position, self._tip.radius = points, place, self._tip_size()

    def _tip_size(self) -> float:
        return self.tip_radius * VIEW_SIZE / self._size

    def _draw_feature(self, feature: Feature) -> None:
        shape = feature_mesh(drawn_at_least(feature, LEAST_FEATURE_SHARE * self._size))
        colour = CHOSEN_COLOUR if feature.id == self._chosen else _colour(feature)
        mesh = self.server.scene.add_mesh_simple(
            f"/features/{feature.id}", self._view(shape.vertices).astype(np.float32), shape.faces, color=colour,
            flat_shading=True, side="double", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        mesh.on_click(lambda _, name=feature.id: self.picked(name))
        self._meshes[feature.id] = mesh


def _colour(feature: Feature) -> tuple[int, ...]:
    return tuple(round(255 * float(each)) for each in kind_of(feature).colour[:3])


def _grown(array: NDArray[Any], room: int) -> NDArray[Any]:
    """The array with room for so many rows."""
    larger = np.empty((room, *array.shape[1:]), array.dtype)
    larger[: len(array)] = array
    return larger
