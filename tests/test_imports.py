"""The house's rules of import: one direction at every level, through doorways, nothing heavy before it is needed."""

from __future__ import annotations

import ast
import importlib
import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("mapping", "hw", "planners", "explore3d")  # each imports itself and those before it
# What takes long to import: the reason that lets an import stand inside a function
HEAVY = {"numba", "scipy", "open3d", "matplotlib", "igl", "emcee", "trimesh", "plotly", "pydantic", "typer", "rich"}
HEAVY |= {"mcap", "zstandard", "serial", "arviz", "viser"}
# The command line answers before even numpy is loaded, and before what starts processes
HEAVY_FOR_THE_COMMAND_LINE = HEAVY | {"numpy", "concurrent"}
# Never loaded by importing a module of ours, the kernels apart
ON_DEMAND = ("open3d", "emcee", "matplotlib", "numba", "trimesh", "plotly", "igl", "scipy.optimize", "scipy.stats")
ON_DEMAND += ("scipy.spatial", "IPython", "dash", "rich.progress")

# Ways in of a few lines, that hand on as doorways do
WAYS_IN = {"explore3d.__main__", "explore3d.run", "explore3d.analyze"}


@dataclass(frozen=True)
class Import:
    """One imported name: the file that imports, what its statement names, and the file that the name lives in."""

    file: str
    named: str
    target: str
    when: str  # "top", "function" or "typing"
    line: int


@cache
def modules() -> dict[str, Path]:
    """Every module of the four packages by its name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(modules()[module].read_text())


def is_folder(module: str) -> bool:
    return modules()[module].name == "__init__.py"


def folder_of(module: str) -> str:
    return module if is_folder(module) else module.rpartition(".")[0]


@cache
def gives(folder: str) -> dict[str, str]:
    """The names on a folder's doorway, and the file of each, read from its source."""
    for node in tree(folder).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_PUBLIC":
            table = ast.literal_eval(node.value)
            return {name: f"{folder}.{file}" for file, names in table.items() for name in names}
    return {}


def home(folder: str, name: str) -> str | None:
    """The file that a name on a folder's doorway lives in, from doorway to doorway."""
    given = gives(folder).get(name)
    return (home(given, name) or given) if given in modules() and is_folder(given) else given


@cache
def imports_in(module: str) -> tuple[tuple[ast.Import | ast.ImportFrom, str], ...]:
    """A module's import statements, and when they are carried out."""
    return tuple(statements(tree(module)))


def statements(node: ast.AST, when: str = "top") -> Iterator[tuple[ast.Import | ast.ImportFrom, str]]:
    """Import statements below a node, and when they are carried out."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, when
        elif isinstance(child, ast.expr):
            continue  # no expression holds a statement
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from statements(child, "function" if when == "top" else when)
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            yield from statements(child, "typing")
        else:
            yield from statements(child, when)


@cache
def imports() -> tuple[Import, ...]:
    """Every import of ours by ours, those inside functions and of type checkers included."""
    found = []
    for module in modules():
        for node, when in imports_in(module):
            if isinstance(node, ast.Import):
                named = [(alias.name, alias.name) for alias in node.names]
            else:
                assert not node.level, f"{module}, line {node.lineno}: a relative import"
                named = [(node.module or "", f"{node.module}.{alias.name}") for alias in node.names]
            for statement, full in named:
                if statement.split(".")[0] not in PACKAGES:
                    continue
                given = home(statement, full.rpartition(".")[2]) if is_folder(statement) else None
                reached = full if full in modules() else statement
                found.append(Import(module, statement if given else reached, given or reached, when, node.lineno))
    return tuple(found)


@cache
def outside(module: str, when: str = "top") -> set[str]:
    """Packages of others that a module imports when it is imported."""
    names = set()
    for node, moment in imports_in(module):
        if moment == when:
            full = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            names |= {name.split(".")[0] for name in full}
    return names - set(PACKAGES)


@cache
def loaded_next() -> dict[str, set[str]]:
    """Modules of ours that each one loads when it is imported."""
    after: dict[str, set[str]] = defaultdict(set)
    for each in imports():
        if each.when == "top" and not is_folder(each.file):
            after[each.file].add(each.target)
    return after


@cache
def loads(module: str) -> frozenset[str]:
    """Packages of others that are loaded when a module of ours is imported, by way of ours too."""
    after = loaded_next()
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        here = waiting.pop()
        if here not in seen:
            seen.add(here)
            waiting += after.get(here, ())
    return frozenset().union(*(outside(each) for each in seen))


def assert_no_cycle(arrows: set[tuple[str, str]]) -> None:
    graph = defaultdict(set)
    for a, b in arrows:
        graph[a].add(b)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_a_package_imports_only_itself_and_those_to_its_right() -> None:
    order = {package: number for number, package in enumerate(PACKAGES)}
    wrong = [each for each in imports() if order[each.target.split(".")[0]] > order[each.file.split(".")[0]]]
    assert not wrong


def test_planners_know_moves_and_limits_but_no_driver() -> None:
    used = {each.target for each in imports() if each.file.startswith("planners.") and each.target.startswith("hw")}
    assert used <= {"hw.move", "hw.errors", "hw.finger"}


def test_the_files_form_no_cycle_imports_inside_functions_and_doorways_included() -> None:
    assert_no_cycle({(each.file, each.target) for each in imports() if each.file != each.target})


def test_the_folders_form_no_cycle_a_room_with_its_own_rooms_neither() -> None:
    using = [each for each in imports() if not is_folder(each.file) and each.file not in WAYS_IN]
    pairs = {(folder_of(each.file), folder_of(each.target)) for each in using}
    assert_no_cycle({(a, b) for a, b in pairs if a != b})


@pytest.mark.parametrize("parent", [m for m in modules() if is_folder(m)])
def test_the_entries_of_a_folder_form_no_cycle(parent: str) -> None:
    def entry(module: str) -> str | None:
        return module[len(parent) + 1 :].split(".")[0] if module.startswith(parent + ".") else None

    pairs = {(entry(each.file), entry(each.target)) for each in imports() if not is_folder(each.file)}
    assert_no_cycle({(a, b) for a, b in pairs if a and b and a != b})


def test_another_folders_inside_is_imported_through_its_doorway() -> None:
    past = [
        f"{each.file}, line {each.line}: {each.named}"
        for each in imports()
        if not is_folder(each.file) and not is_folder(each.named) and folder_of(each.named) != folder_of(each.file)
    ]
    assert not past


def test_an_import_inside_a_function_has_a_heavy_reason() -> None:
    idle = [
        f"{each.file}, line {each.line}: {each.target}"
        for each in imports()
        if each.when == "function"
        and not loads(each.target) & (HEAVY_FOR_THE_COMMAND_LINE if each.file.startswith("explore3d.cli") else HEAVY)
    ]
    assert not idle


def test_no_folder_holds_more_than_a_person_keeps_in_mind() -> None:
    for folder in (name for name in modules() if is_folder(name)):
        entries = {
            e.stem for e in modules()[folder].parent.iterdir() if e.suffix == ".py" or (e / "__init__.py").exists()
        }
        grouping = all((modules()[folder].parent / e).is_dir() for e in entries - {"__init__"})
        assert len(entries) <= 16 and (grouping or len(entries) >= 4), (folder, sorted(entries))


@pytest.mark.parametrize("folder", [m for m in modules() if is_folder(m) and gives(m)])
def test_a_doorway_says_the_same_to_people_to_type_checkers_and_at_run_time(folder: str) -> None:
    typed = {alias.name for node, when in imports_in(folder) if when == "typing" for alias in node.names}
    assert typed == set(gives(folder))
    door = importlib.import_module(folder)
    assert set(door.__all__) == set(gives(folder))
    assert ast.get_docstring(tree(folder))
    light = [name for name, file in gives(folder).items() if not file.endswith("_kernels")]
    for name in light:
        assert getattr(door, name) is getattr(importlib.import_module(gives(folder)[name]), name)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'; its public names: "):
        _ = door.nonsense


def test_a_public_name_that_reads_like_its_file_is_not_covered_by_it() -> None:
    code = "import mapping.detection.detect, mapping.detection; print(callable(mapping.detection.detect))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert run.stdout.strip() == "True"


def test_a_constants_name_has_one_value_in_the_whole_house() -> None:
    values = defaultdict(set)
    for module in modules():
        for node in tree(module).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            value = getattr(node, "value", None)
            for target in targets if isinstance(node, ast.Assign | ast.AnnAssign) and value is not None else ():
                several = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
                pairs = zip(target.elts, value.elts, strict=True) if several else [(target, value)]
                for name, each in pairs:
                    if isinstance(name, ast.Name) and name.id.isupper() and not name.id.startswith("_"):
                        values[name.id].add(ast.unparse(each))
    assert len(values) > 400
    assert {name: found for name, found in values.items() if len(found) > 1} == {}


def test_array_types_are_defined_once() -> None:
    aliases = [
        (module, ast.unparse(node))
        for module in modules()
        for node in tree(module).body
        if isinstance(node, ast.Assign) and ast.unparse(node.value).startswith("NDArray[")
    ]
    assert {module for module, _ in aliases} == {"mapping.arrays"}


def test_only_one_module_imports_open3d() -> None:
    users = {module for module in modules() for when in ("top", "function") if "open3d" in outside(module, when)}
    assert users == {"mapping.geometry.mesh.open3d_import"}


def test_importing_any_module_but_the_kernels_loads_nothing_heavy() -> None:
    light = [name for name in modules() if not name.endswith("_kernels")]
    code = (
        "import importlib, json, sys\n"
        f"culprits = {{}}\nfor name in {light!r}:\n"
        "    importlib.import_module(name)\n"
        f"    for heavy in {ON_DEMAND!r}:\n"
        "        if heavy in sys.modules: culprits.setdefault(heavy, name)\n"
        "print(json.dumps(culprits))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert json.loads(result.stdout.splitlines()[-1]) == {}


@pytest.mark.skipif(sys.platform == "win32", reason="processor time of children is not known there")
def test_help_takes_less_than_a_third_of_a_second() -> None:
    import resource

    def seconds(*command: str) -> float:
        """Processor time, which a busy machine does not lengthen as it does the clock's."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *command], capture_output=True, check=True, cwd=ROOT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    # where processes are slow to start, the start of typer and rich tells how slow: 0.15 s where they are quick
    slow = max(1.0, min(seconds("-c", "import typer, rich.console") for _ in range(5)) / 0.15)
    assert min(seconds("-m", "explore3d", "--help") for _ in range(5)) < 0.3 * slow


def test_help_loads_no_arrays() -> None:
    code = "import sys, explore3d.cli.main; print('numpy' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert result.stdout == "False\n"
