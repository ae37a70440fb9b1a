"""The annotated model as GLB (glTF 2.0): the base, and one named node per feature with its record in `extras`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

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


def glb_bytes(
    base: Surface,
    features: Sequence[Feature],
    reach: FloatArray | None = None,
    sigma: FloatArray | None = None,
    deviation: FloatArray | None = None,
) -> bytes:
    """The scene as one GLB file.

    Nodes: "object", which turns z up to glTF's y up, and below it "base" and one per feature, named by its id, with
    the feature's record (docs/model.md) in `extras`. Float32 vertex attributes: `_SIGMA`, standard deviation of the
    surface there, m; `_REACH`, 0 touched, 1 bridged, 2 extrapolated; both -1 where not known. A base that departs from
    the model that was given has `_DEVIATION` as well, m, and its vertices' colours show it. Vertices are stored
    relative to the middle of the base, which the nodes' matrices add back: float32 would lose it far from the origin.
    """
    import trimesh

    scene = trimesh.Scene()
    scene.graph.update(OBJECT_NODE, "world", matrix=UPRIGHT)
    origin = base.bounds.mean(axis=0)
    _add(scene, "base", base, origin, GLB_BASE_COLOUR, sigma, reach, deviation)
    for feature in features:
        mesh = feature_mesh(feature)
        # The central 90 % of a Gaussian is 2 * 1.645 standard deviations wide.
        spread = np.full(len(mesh.vertices), (feature.height.high - feature.height.low) / 3.29)
        touched = np.zeros(len(mesh.vertices))
        _add(scene, feature.id, mesh, origin, kind_of(feature).colour, spread, touched)
    extras: dict[str, Any] = {feature.id: feature_record(feature) for feature in features}
    extras["base"] = {"schema": MODEL_SCHEMA, "units": "m"}

    def annotate(tree: dict[str, Any]) -> None:
        for node in tree["nodes"]:
            if node["name"] in extras:
                node["extras"] = extras[node["name"]]

    return bytes(trimesh.exchange.gltf.export_glb(scene, tree_postprocessor=annotate))


def _add(
    scene: Any,
    name: str,
    surface: Surface,
    origin: FloatArray,
    colour: tuple[float, float, float, float],
    sigma: FloatArray | None,
    reach: FloatArray | None,
    deviation: FloatArray | None = None,
) -> None:
    import trimesh

    mesh = trimesh.Trimesh(surface.vertices - origin, surface.faces, process=False)
    if deviation is None:
        material = trimesh.visual.material.PBRMaterial(
            name=name, baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=0.7, doubleSided=True
        )
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
    else:
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=deviation_colours(deviation))
        mesh.vertex_attributes["_DEVIATION"] = deviation.astype(np.float32)
    for key, values in (("_SIGMA", sigma), ("_REACH", reach)):
        known = (
            np.full(len(surface.vertices), UNKNOWN_ATTRIBUTE)
            if values is None
            else np.nan_to_num(values, nan=UNKNOWN_ATTRIBUTE)
        )
        mesh.vertex_attributes[key] = known.astype(np.float32)
    transform = np.eye(4)
    transform[:3, 3] = origin
    scene.add_geometry(mesh, node_name=name, geom_name=name, parent_node_name=OBJECT_NODE, transform=transform)


def deviation_colours(deviation: FloatArray) -> FloatArray:
    """(V, 3) red, green, blue from 0 to 1: from blue, where the body lies deepest under its model, to red."""
    largest = float(np.abs(deviation).max(initial=0.0)) or 1.0
    share = np.clip(np.abs(deviation) / largest, 0.0, 1.0)[:, None]
    ends = np.where((deviation > 0)[:, None], STANDS_OUT_COLOUR, LIES_UNDER_COLOUR)
    return np.asarray((1.0 - share) * np.array(GLB_BASE_COLOUR[:3]) + share * ends)
