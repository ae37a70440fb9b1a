"""The annotated model as GLB (glTF 2.0): the base, and one named node per feature with its record in `extras`."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping import Feature, FloatArray, Surface
from mapping.inference.kinds import kind_of
from mapping.model.feature_mesh import feature_mesh
from mapping.model.json_record import MODEL_SCHEMA, feature_record

GLB_BASE_COLOUR = (0.78, 0.80, 0.83, 1.0)
# Ends of the scale of deviations, red and blue
STANDS_OUT_COLOUR, LIES_UNDER_COLOUR = np.array([0.70, 0.09, 0.17]), np.array([0.13, 0.40, 0.67])
# glTF allows no NaN in a vertex attribute: this stands for "not known".
UNKNOWN_ATTRIBUTE = -1.0
# glTF 2.0 (3.4, coordinate system and units): +Y is up, +Z forward. The node that turns the object's +Z up there
OBJECT_NODE = "object"
UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

# Numbers of the standard: a primitive's mode, what a view is for, the types of components; chunks and views are aligned
TRIANGLES, VERTICES, FACES, ALIGNED = 4, 34962, 34963, 4
COMPONENTS = {"|u1": 5121, "<u4": 5125, "<f4": 5126}


def glb_bytes(
    base: Surface,
    features: Sequence[Feature],
    reach: FloatArray | None = None,
    sigma: FloatArray | None = None,
    deviation: FloatArray | None = None,
    proven: Mapping[str, FloatArray | None] | None = None,
) -> bytes:
    """The scene as one GLB file.

    Nodes: "object", which turns z up to glTF's y up, and below it "base" and one per feature, named by its id, with
    the feature's record (docs/model.md) in `extras`. Float32 vertex attributes: `_SIGMA`, standard deviation of the
    surface there, m; `_REACH`, 0 touched, 1 bridged, 2 extrapolated; both -1 where not known. `proven` are further
    attributes of the base, m, by their names. A base that departs from the model that was given has `_DEVIATION` as
    well, m, and its vertices' colours show it. Vertices are stored relative to the middle of the base, which the nodes'
    matrices add back: float32 would lose it far from the origin.
    """
    scene, origin = _Scene(), base.bounds.mean(axis=0)
    scene.add("base", base, origin, GLB_BASE_COLOUR, sigma, reach, deviation, proven)
    scene.nodes[-1]["extras"] = {"schema": MODEL_SCHEMA, "units": "m"}
    for feature in features:
        mesh = feature_mesh(feature)
        # The central 90 % of a Gaussian is 2 * 1.645 standard deviations wide.
        spread = np.full(len(mesh.vertices), (feature.height.high - feature.height.low) / 3.29)
        touched = np.zeros(len(mesh.vertices))
        scene.add(feature.id, mesh, origin, kind_of(feature).colour, spread, touched)
        scene.nodes[-1]["extras"] = feature_record(feature)
    return scene.glb()


class _Scene:
    """A glTF tree and its buffer: written here, for importing trimesh takes longer than all else about a model."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._views: list[dict[str, int]] = []
        self._buffer = bytearray()
        self._known: dict[tuple[str, str, bytes], int] = {}

    def add(
        self,
        name: str,
        surface: Surface,
        origin: FloatArray,
        colour: tuple[float, float, float, float],
        sigma: FloatArray | None,
        reach: FloatArray | None,
        deviation: FloatArray | None = None,
        proven: Mapping[str, FloatArray | None] | None = None,
    ) -> None:
        """A node with a mesh of its own, moved by the origin that its vertices are relative to."""
        attributes = {"POSITION": self._accessor((surface.vertices - origin).astype("<f4"))}
        for key, values in (("_SIGMA", sigma), ("_REACH", reach)):
            known = np.full(len(surface.vertices), np.nan) if values is None else values
            attributes[key] = self._accessor(np.nan_to_num(known, nan=UNKNOWN_ATTRIBUTE).astype("<f4"))
        for key, values in (proven or {}).items():
            if values is not None:
                attributes[key] = self._accessor(np.where(np.isfinite(values), values, UNKNOWN_ATTRIBUTE).astype("<f4"))
        primitive: dict[str, Any] = {"attributes": attributes, "mode": TRIANGLES}
        primitive["indices"] = self._accessor(surface.faces.ravel().astype("<u4"), FACES)
        if deviation is None:
            surfaced = {"baseColorFactor": list(colour), "metallicFactor": 0.0, "roughnessFactor": 0.7}
            primitive["material"] = len(self._materials)
            self._materials.append({"name": name, "pbrMetallicRoughness": surfaced, "doubleSided": True})
        else:
            opaque = np.column_stack([deviation_colours(deviation), np.ones(len(deviation))])
            attributes["COLOR_0"] = self._accessor(np.round(255.0 * opaque).astype("u1"))
            attributes["_DEVIATION"] = self._accessor(deviation.astype("<f4"))
        matrix = np.eye(4)
        matrix[:3, 3] = origin
        self.nodes.append({"name": name, "mesh": len(self._meshes), "matrix": matrix.T.ravel().tolist()})
        self._meshes.append({"name": name, "primitives": [primitive]})

    def _accessor(self, values: NDArray[Any], target: int = VERTICES) -> int:
        """The number of an accessor of (N,) or (N, 3 or 4) values; one that is there already is taken again."""
        content = values.tobytes()
        key = values.dtype.str, str(values.shape[1:]), content
        if key not in self._known:
            self._known[key] = len(self._accessors)
            record: dict[str, Any] = {"bufferView": len(self._views), "count": len(values)}
            record |= {"componentType": COMPONENTS[values.dtype.str]}
            record["type"] = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
            if values.dtype == np.uint8:
                record["normalized"] = True
            if len(values):
                record |= {"min": np.atleast_1d(values.min(axis=0)).tolist()}
                record |= {"max": np.atleast_1d(values.max(axis=0)).tolist()}
            self._accessors.append(record)
            view = {"buffer": 0, "byteOffset": len(self._buffer), "byteLength": len(content), "target": target}
            self._views.append(view)
            self._buffer += content + bytes(-len(content) % ALIGNED)
        return self._known[key]

    def glb(self) -> bytes:
        """The container: its head, the tree as JSON, the buffer."""
        upright = {"name": OBJECT_NODE, "matrix": UPRIGHT.T.ravel().tolist()}
        tree: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "explore3d"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [upright | {"children": list(range(1, len(self.nodes) + 1))}, *self.nodes],
            "meshes": self._meshes,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._buffer)}],
        }
        if self._materials:  # an empty list is not allowed
            tree["materials"] = self._materials
        text = json.dumps(tree, separators=(",", ":")).encode()
        text += b" " * (-len(text) % ALIGNED)
        length = 12 + 8 + len(text) + 8 + len(self._buffer)
        head = struct.pack("<4sIII4s", b"glTF", 2, length, len(text), b"JSON")
        return head + text + struct.pack("<I4s", len(self._buffer), b"BIN\0") + bytes(self._buffer)


def deviation_colours(deviation: FloatArray) -> FloatArray:
    """(V, 3) red, green, blue from 0 to 1: from blue, where the body lies deepest under its model, to red."""
    largest = float(np.abs(deviation).max(initial=0.0)) or 1.0
    share = np.clip(np.abs(deviation) / largest, 0.0, 1.0)[:, None]
    ends = np.where((deviation > 0)[:, None], STANDS_OUT_COLOUR, LIES_UNDER_COLOUR)
    return np.asarray((1.0 - share) * np.array(GLB_BASE_COLOUR[:3]) + share * ends)
