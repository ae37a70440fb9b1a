"""A kind of feature is one thing: the rest of the house asks it, and names none."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from explore3d.report.findings import feature_line
from mapping.errors import MappingError
from mapping.feature import Feature, Interval, Support
from mapping.inference.kinds.kind import KINDS, Kind, kind_made_of, kind_named, kind_of, sizes_of
from mapping.model.glb import glb_bytes
from mapping.model.json_record import feature_record, read_feature
from mapping.surface import Surface

ROOT = Path(__file__).resolve().parents[4]
HOME = ROOT / "mapping" / "inference" / "kinds"
# Truths are stated there, not asked for
TRUTHS = ROOT / "explore3d" / "bench" / "scenes"
NAMES = {*KINDS, *(kind_named(name).plural for name in KINDS)}


def constants(node: ast.AST) -> set[str]:
    found = {each.value for each in ast.walk(node) if isinstance(each, ast.Constant) and isinstance(each.value, str)}
    return found & NAMES


def namings(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of what tells kinds apart by their names.

    A comparison, a case, a table by kind, a choice of several kinds, or the beginning of a name.
    """
    for node in ast.walk(ast.parse(source)):
        tests: list[ast.AST] = []
        if isinstance(node, ast.Compare | ast.MatchValue):
            tests = [node]
        elif isinstance(node, ast.Dict) and len([key for key in node.keys if key and constants(key)]) > 1:
            tests = [key for key in node.keys if key]
        elif isinstance(node, ast.Tuple | ast.List | ast.Set):
            tests = [node] if sum(isinstance(e, ast.Constant) and bool(constants(e)) for e in node.elts) > 1 else []
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            tests = list(node.args) if node.func.attr in ("startswith", "endswith", "index", "count") else []
        if any(constants(test) for test in tests):
            yield node.lineno, ast.unparse(node)[:80]


def test_what_tells_kinds_apart_by_name_is_noticed() -> None:
    for source in (
        'feature.kind == "step"',
        'kind in ("ridge", "groove")',
        '{"bump": 1, "pit": 2}[kind]',
        'LINES = ("ridge", "step")',
        'crossing.kind.startswith("step")',
        'match kind:\n    case "pit": pass',
    ):
        assert list(namings(source)), source
    assert not list(namings('axes.hist(x, histtype="step")\nTrueFeature("ridge", axis)'))


def test_no_other_file_tells_kinds_apart_by_their_names() -> None:
    named = []
    for package in ("mapping", "hw", "planners", "explore3d"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if path.parent not in (HOME, TRUTHS) and path.name != "__init__.py":
                named += [f"{path.relative_to(ROOT)}:{line}: {text}" for line, text in namings(path.read_text("utf-8"))]
    assert named == []


def test_every_kind_of_the_table_bears_its_name() -> None:
    assert all(kind_named(name).name == name for name in KINDS)
    assert [name for name in KINDS if not kind_named(name).sampled] == ["convex edge", "concave corner"]


def test_the_grammar_has_one_kind_for_whatever_sweeps_cross() -> None:
    made = [kind_made_of(c, line=line).name for c in ("convex", "concave", "step") for line in (False, True)]
    assert made == ["bump", "ridge", "pit", "groove", "step", "step"]
    with pytest.raises(MappingError, match="nothing is made of 'odd' crossings"):
        kind_made_of("odd", line=True)


def test_an_unknown_kind_is_told_with_those_that_are_known() -> None:
    with pytest.raises(MappingError, match="unknown kind 'dent'; possible: ridge, bump, groove, pit, step"):
        kind_named("dent")


@pytest.fixture
def scratch(monkeypatch: pytest.MonkeyPatch) -> Kind:
    """A kind that only this test knows: one value in a file of its own, and one line in the table."""
    module = ModuleType("scratches")
    found = Kind(name="scratch", plural="scratches", sign=-1, line=True, words={"height": "deep"}, colour=(0, 1, 0, 1))
    module.__dict__["SCRATCH"] = found
    monkeypatch.setitem(sys.modules, "scratches", module)
    monkeypatch.setitem(KINDS, "scratch", "scratches:SCRATCH")
    return found


def test_a_kind_in_the_table_is_one_for_model_pictures_and_report(scratch: Kind) -> None:
    axis, up = np.array([[-0.01, 0.0, 0.0], [0.01, 0.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    deep, wide = Interval.normal(-1e-4, 1e-5), Interval(1e-3, 5e-4, 2e-3)
    feature = Feature("scratch", axis, up, deep, wide, Interval.normal(0.02, 1e-3), Support(9.0, 3), True, 1e-4)
    feature = replace(feature, id="scratch-1")
    assert kind_of(feature) is scratch
    assert read_feature({**feature_record(feature)}, None).kind == "scratch"
    plate = Surface([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert b'"scratch-1"' in glb_bytes(plate, [feature])
    assert "scratch-1: height" in feature_line(feature)


def test_a_height_that_may_be_nothing_is_looked_for_over_a_width() -> None:
    """Places along a line lie as near to each other as its disturbance is narrow: there were hundreds of millions."""
    known = Interval(0.0, 0.0, 35e-9)
    axis, up = np.array([[0.0, 0.0, 0.0], [3e-4, 0.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    nothing = Interval(0.0, 0.0, 0.0)
    step = Feature("step", axis, up, known, nothing, Interval(3e-4, 3e-4, 3e-4), Support(3.0, 2, (3,)), False, 1e-6)
    assert sizes_of(step, 2e-6).half_width > 0.05e-6
