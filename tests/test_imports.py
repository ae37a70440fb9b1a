"""The house's rules of import: one direction, no cycles, nothing heavy before it is needed."""

from __future__ import annotations

import ast
import importlib
import json
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("mapping", "hw", "planners", "explore3d")  # each imports itself and those before it
HEAVY = ("open3d", "emcee", "matplotlib", "numba", "trimesh", "plotly", "igl", "scipy.optimize", "scipy.stats")
HEAVY += ("scipy.spatial", "IPython", "dash", "rich.progress")


@cache
def modules() -> dict[str, Path]:
    """Every module of the four packages by its name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(tree: ast.AST) -> set[str]:
    """The modules of ours that a piece of source names in import statements."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= (full & set(modules())) or {node.module}
    return {name for name in names if name.split(".")[0] in PACKAGES}


def at_import_time(tree: ast.Module) -> ast.Module:
    """The source without functions' bodies and without what only type checkers read."""

    class Pruner(ast.NodeTransformer):
        def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
            return None

        def visit_If(self, node: ast.If) -> ast.AST | None:
            return None if "TYPE_CHECKING" in ast.unparse(node.test) else self.generic_visit(node)

    return Pruner().visit(tree)


@pytest.mark.parametrize("name", modules())
def test_a_package_imports_only_itself_and_those_to_its_right(name: str) -> None:
    package = name.split(".")[0]
    allowed = PACKAGES[: PACKAGES.index(package) + 1]
    wrong = {other for other in imported(ast.parse(modules()[name].read_text())) if other.split(".")[0] not in allowed}
    assert not wrong, f"{name} imports {wrong}"


@pytest.mark.parametrize("name", [name for name in modules() if name.startswith("planners.")])
def test_planners_know_moves_and_limits_but_no_driver(name: str) -> None:
    used = {other for other in imported(ast.parse(modules()[name].read_text())) if other.split(".")[0] == "hw"}
    assert used <= {"hw.moves", "hw.errors", "hw.finger"}, f"{name} imports {used}"


def test_no_import_is_relative() -> None:
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text())):
            assert not (isinstance(node, ast.ImportFrom) and node.level), f"{name}, line {node.lineno}"


def test_the_modules_form_no_cycle() -> None:
    graph = {name: imported(at_import_time(ast.parse(path.read_text()))) for name, path in modules().items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_only_one_module_imports_open3d() -> None:
    users = []
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text())):
            named = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            users += [name for other in named if other.split(".")[0] == "open3d"]
    assert set(users) <= {"mapping.open3d_import"}


def test_importing_any_module_but_the_kernels_loads_nothing_heavy() -> None:
    light = [name for name in modules() if not name.endswith("_kernels")]
    code = (
        "import importlib, json, sys\n"
        f"culprits = {{}}\nfor name in {light!r}:\n"
        "    importlib.import_module(name)\n"
        f"    for heavy in {HEAVY!r}:\n"
        "        if heavy in sys.modules: culprits.setdefault(heavy, name)\n"
        "print(json.dumps(culprits))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert json.loads(result.stdout.splitlines()[-1]) == {}


@pytest.mark.parametrize("package", ["mapping", "hw", "planners"])
def test_every_public_name_is_there_and_listed_once(package: str) -> None:
    module = importlib.import_module(package)
    assert set(module._PUBLIC) == set(module.__all__)
    for name in module.__all__:
        assert getattr(module, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'; its public names: "):
        _ = module.nonsense


@pytest.mark.skipif(sys.platform == "win32", reason="processor time of children is not known there")
def test_help_takes_less_than_a_third_of_a_second() -> None:
    import resource

    def seconds() -> float:
        """Processor time, which a busy machine does not lengthen as it does the clock's."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-m", "explore3d.cli", "--help"], capture_output=True, check=True, cwd=ROOT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    assert min(seconds() for _ in range(5)) < 0.3
