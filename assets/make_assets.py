"""Make the meshes of assets/meshes and the truth tables of assets/scenes: python assets/make_assets.py.

Everything follows from the numbers below, so a second run writes the same bytes. Lengths in metres.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from solids import Solid, bowl, double_ring, folds, holed_plate, level_set, vase
from triangles import Mesh, dome, extruded, grid_faces, height_field, together, tube, walls, welded, write_ply

from explore3d.bench.scenes import BODY_BUILDING_SEEDS, Detail, drawn_details, laid_on
from mapping import Surface
from mapping.arrays import FloatArray

Sizes = dict[str, Any]
FOLDER = Path(__file__).resolve().parent
MARK = "# Truth of the simulated object, written by make_assets.py"


def main() -> None:
    """Write every mesh and every truth table."""
    make_plate()
    make_wire()
    make_tile()
    make_bump_of_revolution()
    make_step()
    make_mug()
    make_l_bracket()
    make_bodies()


TILT = np.radians(45.0)
PLATE = (0.200, 0.150)
WIRE: Sizes = {"diameter": 0.65e-3, "length": 0.080, "center": (0.012, -0.007), "direction": np.radians(25.0)}


def make_plate() -> None:
    """The upper face of a plate tilted by 45 degrees about x, alone."""
    u, v = (np.linspace(-size / 2, size / 2, 41) for size in PLATE)
    vertices, faces = height_field(u, v, np.zeros((len(u), len(v))))
    write_mesh("plate", (tilted(vertices), faces))
    write_truth("empty_plate", [])


def make_wire() -> None:
    """The plate with a straight wire, cut square at both ends, lying on it."""
    u, v = (np.linspace(-size / 2, size / 2, 41) for size in PLATE)
    radius = WIRE["diameter"] / 2
    along = np.array([np.cos(WIRE["direction"]), np.sin(WIRE["direction"]), 0.0])
    ends = np.array([*WIRE["center"], 0.0]) + WIRE["length"] / 2 * np.array([[-1.0], [1.0]]) * along
    path = ends[0] + np.linspace(0, 1, 21)[:, None] * (ends[1] - ends[0])
    wire = tube(
        path + np.array([0.0, 0.0, radius]),
        np.tile([0.0, 0.0, 1.0], (len(path), 1)),
        radius,
        2 * np.pi * np.arange(64) / 64,
    )
    plate = height_field(u, v, np.zeros((len(u), len(v))))
    vertices, faces = together(plate, wire)
    write_mesh("wire_on_plate", (tilted(vertices), faces))
    truth = {"kind": "ridge", "axis": tilted(ends), "height": 2 * radius, "width": 2 * radius, "length": WIRE["length"]}
    write_truth("wire_on_plate", [truth])


TILE: Sizes = {"size": (0.060, 0.040), "diameter": 0.65e-3, "length": 0.028, "center": (0.004, -0.002)}


def make_tile() -> None:
    """A small level tile and a short straight wire on it, for stages with little travel and no time."""
    u, v = (np.linspace(-size / 2, size / 2, 13) for size in TILE["size"])
    radius = TILE["diameter"] / 2
    along = np.array([np.cos(np.radians(35.0)), np.sin(np.radians(35.0)), 0.0])
    ends = np.array([*TILE["center"], 0.0]) + TILE["length"] / 2 * np.array([[-1.0], [1.0]]) * along
    path = ends[0] + np.linspace(0, 1, 15)[:, None] * (ends[1] - ends[0])
    lifted = path + np.array([0.0, 0.0, radius])
    wire = tube(lifted, np.tile([0.0, 0.0, 1.0], (len(path), 1)), radius, 2 * np.pi * np.arange(64) / 64)
    tile = height_field(u, v, np.zeros((len(u), len(v))))
    write_mesh("tile", tile)
    write_mesh("wire_on_tile", together(tile, wire))
    truth = {"kind": "ridge", "axis": ends, "height": 2 * radius, "width": 2 * radius, "length": TILE["length"]}
    for scene in ("grbl_peck", "grbl_slide", "unknown_plate"):
        write_truth(scene, [truth])


BUMP: Sizes = {"a": 15.0, "reach": 2.2, "plane": 3.0}


def make_bump_of_revolution() -> None:
    """The paper's bump z = 1/(1 + a u^2) out to u = 2.2, past the corners of its base, a square of the plane z = 0."""
    # Rings stand closer where the profile bends more, so that all facets are about equally flat.
    fine = np.linspace(0.0, BUMP["reach"], 20001)
    slope = np.gradient(1.0 / (1.0 + BUMP["a"] * fine**2), fine)
    bend = np.abs(np.gradient(slope, fine)) / (1.0 + slope**2) ** 1.5
    density = np.cumsum(np.sqrt(bend + 0.01 * bend.max()) * np.sqrt(1.0 + slope**2))
    rings = np.interp(np.linspace(density[0], density[-1], 49), density, fine)[1:]
    write_mesh("bump_of_revolution", dome(rings, 1.0 / (1.0 + BUMP["a"] * rings**2), 1.0, sides=96))
    edge = np.linspace(-BUMP["plane"] / 2, BUMP["plane"] / 2, 13)
    write_mesh("square", height_field(edge, edge, np.zeros((13, 13))))
    write_truth("bump_of_revolution", [{"kind": "bump", "axis": np.zeros((1, 3)), "height": 1.0}])


STEP: Sizes = {"size": (0.100, 0.060), "edge": 0.007, "height": 1e-3}


def make_step() -> None:
    """A plate whose part x > edge stands one step higher, and the same plate without the step."""
    low = np.linspace(-STEP["size"][0] / 2, STEP["edge"], 22)
    high = np.linspace(STEP["edge"], STEP["size"][0] / 2, 18)
    y = np.linspace(-STEP["size"][1] / 2, STEP["size"][1] / 2, 25)
    x = np.concatenate([low, high])  # the edge occurs twice: the wall of the step stands between the two
    height = np.repeat(np.concatenate([np.zeros(22), np.full(18, STEP["height"])])[:, None], 25, axis=1)
    write_mesh("step", height_field(x, y, height))
    write_mesh("flat", height_field(np.concatenate([low, high[1:]]), y, np.zeros((39, 25))))
    ends = np.array([[STEP["edge"], y[0], 0.0], [STEP["edge"], y[-1], 0.0]])
    write_truth("step", [{"kind": "step", "axis": ends, "height": STEP["height"], "length": STEP["size"][1]}])


MUG: Sizes = {"radius": 0.040, "height": 0.100, "sides": 240}
RIDGE: Sizes = {"radius": 0.4e-3, "turn": np.radians([20.0, 110.0]), "rise": (0.025, 0.075)}
GROOVE: Sizes = {"angle": np.radians(200.0), "width": 3e-3, "depth": 0.25e-3, "from": 0.030, "to": 0.070}
BUMPS: tuple[Sizes, ...] = (
    {"angle": np.radians(150.0), "z": 0.060, "height": 1.0e-3, "radius": 1.5e-3},
    {"angle": np.radians(280.0), "z": 0.040, "height": 0.6e-3, "radius": 2.0e-3},
)


def make_mug() -> None:
    """The wall of a mug, alone, and with a helical wire, a groove and two round bumps."""
    write_mesh("mug", mug_wall(depth=0.0))
    crest = helix(np.linspace(0.0, 1.0, 121), MUG["radius"] + RIDGE["radius"])
    up = crest * [1.0, 1.0, 0.0] / (MUG["radius"] + RIDGE["radius"])
    # The ball meets the wire within 40 degrees of its crest: only there the facets must be fine.
    angles = np.radians([*np.arange(-60, 61, 6), 105, 180, 255])
    bumps = [cap_on_mug(bump) for bump in BUMPS]
    write_mesh(
        "mug_with_details", together(mug_wall(GROOVE["depth"]), tube(crest, up, RIDGE["radius"], angles), *bumps)
    )
    write_truth("mug", mug_truth())


def mug_wall(depth: float) -> Mesh:
    """The cylinder with a groove of that depth; its facets are the same for every depth but in the groove."""
    half = np.arcsin(GROOVE["width"] / 2 / MUG["radius"])
    rims = np.array([GROOVE["angle"] - half, GROOVE["angle"] + half])
    angles = np.sort(np.concatenate([2 * np.pi * np.arange(MUG["sides"]) / MUG["sides"], rims]))
    z = np.union1d(np.linspace(0.0, MUG["height"], 6), [GROOVE["from"], GROOVE["to"]])
    angles, across = walls(angles, rims)
    z, along = walls(z, np.array([GROOVE["from"], GROOVE["to"]]))
    radius = MUG["radius"] - depth * np.outer(along, across)
    points = [radius * np.cos(angles), radius * np.sin(angles), np.repeat(z[:, None], len(angles), axis=1)]
    vertices, faces = np.stack(points, axis=-1).reshape(-1, 3), grid_faces(len(z), len(angles), closed=True)[:, ::-1]
    return welded(vertices, faces)


def helix(share: FloatArray, radius: float) -> FloatArray:
    """Points of the ridge's course at a distance from the mug's axis; share 0 to 1."""
    turn, z = (start + share * (stop - start) for start, stop in (RIDGE["turn"], RIDGE["rise"]))
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def cap_on_mug(bump: Sizes) -> Mesh:
    """A cap of a sphere whose crest stands `height` over the mug; it continues 0.3 mm into the wall."""
    radius, height = bump["radius"], bump["height"]
    polar = np.linspace(0.0, np.arccos(1.0 - (height + 0.3e-3) / radius), 13)[1:]
    vertices, faces = dome(radius * np.sin(polar), height - radius * (1.0 - np.cos(polar)), height, sides=36)
    c, s = np.cos(bump["angle"]), np.sin(bump["angle"])
    rows = np.array([[-s, c, 0.0], [0.0, 0.0, 1.0], [c, s, 0.0]])
    return vertices @ rows + [MUG["radius"] * c, MUG["radius"] * s, bump["z"]], faces


def mug_truth() -> list[dict[str, object]]:
    """The four details as features on the mug."""
    course = helix(np.linspace(0.0, 1.0, 46), MUG["radius"])
    length = np.hypot(MUG["radius"] * np.ptp(RIDGE["turn"]), np.ptp(RIDGE["rise"]))
    size = 2 * RIDGE["radius"]
    ridge = {"kind": "ridge", "axis": course, "height": size, "width": size, "length": length}
    foot = MUG["radius"] * np.array([np.cos(GROOVE["angle"]), np.sin(GROOVE["angle"])])
    groove = {
        "kind": "groove",
        "axis": np.array([[*foot, GROOVE["from"]], [*foot, GROOVE["to"]]]),
        "height": -GROOVE["depth"],
        "width": GROOVE["width"],
        "length": GROOVE["to"] - GROOVE["from"],
    }
    return [ridge, groove, *(bump_truth(bump) for bump in BUMPS)]


def bump_truth(bump: Sizes) -> dict[str, object]:
    """A cap of a sphere: as wide as its circle in the plane that touches the mug."""
    place = [MUG["radius"] * np.cos(bump["angle"]), MUG["radius"] * np.sin(bump["angle"]), bump["z"]]
    width = 2 * np.sqrt(bump["height"] * (2 * bump["radius"] - bump["height"]))
    return {"kind": "bump", "axis": np.array([place]), "height": bump["height"], "width": width}


BRACKET: Sizes = {"long": 0.060, "tall": 0.050, "thick": 0.006, "deep": 0.040}
BRACKET_WIRE = 0.5e-3
# Ends of the wires on the upper face of the foot and on the inner face of the wall, each with its outward normal
BRACKET_WIRES: tuple[Sizes, ...] = (
    {"ends": np.array([[0.020, 0.006, 0.008], [0.048, 0.006, 0.030]]), "up": np.array([0.0, 1.0, 0.0])},
    {"ends": np.array([[0.006, 0.016, 0.008], [0.006, 0.042, 0.028]]), "up": np.array([1.0, 0.0, 0.0])},
)
BRACKET_BUMP: Sizes = {"place": np.array([0.030, 0.0, 0.020]), "height": 0.6e-3, "radius": 2.0e-3}


def make_l_bracket() -> None:
    """An L-bracket with an inner corner, alone, and with a wire on either inner flat and a bump on the underside."""
    thick = BRACKET["thick"]
    x = np.concatenate([np.linspace(0.0, thick, 3), np.linspace(thick, BRACKET["long"], 15)[1:]])
    y = np.concatenate([np.linspace(0.0, thick, 3), np.linspace(thick, BRACKET["tall"], 12)[1:]])
    middle_x, middle_y = 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
    solid = (middle_x < thick)[:, None] | (middle_y < thick)[None, :]
    bracket = extruded(x, y, np.linspace(0.0, BRACKET["deep"], 11), solid)
    write_mesh("l_bracket", bracket)
    wires = [laid_wire(each["ends"], each["up"], BRACKET_WIRE / 2) for each in BRACKET_WIRES]
    write_mesh("l_bracket_with_details", together(bracket, *wires, bump_below(BRACKET_BUMP)))
    size = BRACKET_WIRE
    ridges = [
        {
            "kind": "ridge",
            "axis": e["ends"],
            "height": size,
            "width": size,
            "length": np.linalg.norm(np.ptp(e["ends"], 0)),
        }
        for e in BRACKET_WIRES
    ]
    width = 2 * np.sqrt(BRACKET_BUMP["height"] * (2 * BRACKET_BUMP["radius"] - BRACKET_BUMP["height"]))
    bump = {"kind": "bump", "axis": BRACKET_BUMP["place"][None], "height": BRACKET_BUMP["height"], "width": width}
    write_truth("l_bracket", [*ridges, bump])


def laid_wire(ends: FloatArray, up: FloatArray, radius: float) -> Mesh:
    """A straight wire, cut square at both ends, that lies on a flat of normal `up` (3,) between two places of it."""
    path = ends[0] + np.linspace(0.0, 1.0, 15)[:, None] * (ends[1] - ends[0]) + radius * up
    return tube(path, np.tile(up, (len(path), 1)), radius, 2 * np.pi * np.arange(64) / 64)


def bump_below(bump: Sizes) -> Mesh:
    """A cap of a sphere on a flat whose normal is -y; it continues 0.3 mm into the body."""
    radius, height = bump["radius"], bump["height"]
    polar = np.linspace(0.0, np.arccos(1.0 - (height + 0.3e-3) / radius), 13)[1:]
    vertices, faces = dome(radius * np.sin(polar), height - radius * (1.0 - np.cos(polar)), height, sides=36)
    return vertices @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]) + bump["place"], faces


PLATE_WITH_HOLE: Sizes = {"size": (0.070, 0.050), "thick": 4e-3, "hole": 9e-3}
# Level sets, and the corners of the boxes that hold them
SOLIDS: dict[str, tuple[Solid, FloatArray, FloatArray]] = {
    "vase": (vase, np.array([-0.024, -0.024, -0.040]), np.array([0.050, 0.024, 0.040])),
    "bowl": (bowl, np.array([-0.035, -0.035, -0.035]), np.array([0.035, 0.035, 0.006])),
    "double_ring": (double_ring, np.array([-0.046, -0.028, -0.010]), np.array([0.046, 0.028, 0.010])),
    "folds": (folds, np.array([-0.032, -0.036, -0.038]), np.array([0.037, 0.032, 0.038])),
}
# Where fins begin and end, mm, with gaps between them of 4 mm, into which a tip of 3 mm does not fit, 10 and 12 mm
HEAT_SINK: Sizes = {
    "fins": ((0.0, 6.0), (10.0, 16.0), (26.0, 32.0), (44.0, 50.0)),
    "foot": 8e-3,
    "tall": 24e-3,
    "long": 44e-3,
}
LEVEL_SET_SPACING = 2e-3
BODY_TIP_RADIUS = 3e-3


def make_bodies() -> None:
    """Closed bodies with concave parts, each alone and with details laid on at places of chance."""
    meshes = {name: level_set(solid, low, high, LEVEL_SET_SPACING) for name, (solid, low, high) in SOLIDS.items()}
    meshes |= {"holed_plate": holed_plate(**PLATE_WITH_HOLE), "heat_sink": heat_sink()}
    for name, mesh in meshes.items():
        details = drawn_details(Surface(*mesh), BODY_TIP_RADIUS, np.random.default_rng(BODY_BUILDING_SEEDS[0]))
        write_mesh(f"bodies/{name}", mesh)
        write_mesh(f"bodies/{name}_with_details", laid_on(mesh, details))
        write_truth(name, [laid_truth(each) for each in details])


def heat_sink() -> Mesh:
    """A foot with fins along z that stand on it, inner corners and edges sharp."""
    sides = 1e-3 * np.array(HEAT_SINK["fins"])
    x = np.concatenate([np.linspace(a, b, 4)[:-1] for a, b in pairwise(sides.ravel())] + [sides[-1, -1:]])
    y = np.concatenate(
        [np.linspace(0.0, HEAT_SINK["foot"], 4)[:-1], np.linspace(HEAT_SINK["foot"], HEAT_SINK["tall"], 7)]
    )
    middle_x, middle_y = 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
    in_fin = ((middle_x[:, None] > sides[:, 0]) & (middle_x[:, None] < sides[:, 1])).any(axis=1)
    solid = in_fin[:, None] | (middle_y < HEAT_SINK["foot"])[None, :]
    return extruded(x, y, np.linspace(-0.5, 0.5, 15) * HEAT_SINK["long"], solid)


def laid_truth(detail: Detail) -> dict[str, object]:
    """A detail as a feature; one about a point has no length."""
    known = {"kind": detail.kind, "axis": detail.course, "height": detail.height, "width": detail.width}
    return known | ({"length": detail.truth.length} if len(detail.course) > 1 else {})


def tilted(points: FloatArray) -> FloatArray:
    """Points of the plate's frame (u, v, outward) in the object frame."""
    c, s = np.cos(TILT), np.sin(TILT)
    rotation: FloatArray = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return np.asarray(points @ rotation)


def write_mesh(name: str, mesh: Mesh) -> None:
    """The mesh as assets/meshes/<name>.ply."""
    write_ply(FOLDER / "meshes" / f"{name}.ply", mesh)


def write_truth(scene: str, truths: list[dict[str, object]]) -> None:
    """Replace what stands below MARK in the scene by these features."""
    path = FOLDER / "scenes" / f"{scene}.toml"
    head = path.read_text(encoding="utf-8").split(MARK)[0].rstrip("\n")
    tables = [f"\n[[truth]]\n{''.join(f'{key} = {toml(value)}' + chr(10) for key, value in t.items())}" for t in truths]
    tail = f"\n\n{MARK}\n{''.join(tables)}" if truths else "\n"
    path.write_text(head + tail, encoding="utf-8")


def toml(value: object) -> str:
    """A string, a length in metres to the nanometre, or a polyline of such lengths."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, np.ndarray):
        points = [f"[{', '.join(toml(float(x)) for x in point)}]" for point in np.atleast_2d(value)]
        return f"[{', '.join(points)}]" if len(points) < 4 else "[\n    " + ",\n    ".join(points) + ",\n]"
    return repr(round(float(value), 9) + 0.0)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
