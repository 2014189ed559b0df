"""The package as a whole: rooms in order, light to import, every public name documented."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import lic_drake

PACKAGE = Path(lic_drake.__file__).parent
TREES = {
    path.relative_to(PACKAGE): ast.parse(path.read_text(encoding="utf-8"))
    for path in sorted(PACKAGE.rglob("*.py"))
}
MAX_LINES = 400
MAX_MODULES = 131
MAX_IMPORT_S = 0.3
FLOW = (
    "clutter",
    "robots",
    "scene",
    "control",
    "reach",
    "starts",
    "experience",
    "estimate",
    "select",
    "perception",
    "evaluate",
    "show",
    "cli",
)
"""Rooms from left to right; a module imports only from its own room and from rooms to its left."""


def imports(node: ast.AST, *, in_functions: bool = True) -> Iterator[str]:
    """Yields the dotted name of every module, or member of one, imported below a node."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            origin = "." * child.level + (child.module or "")
            yield from (f"{origin}.{alias.name}" for alias in child.names)
        if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            continue
        if in_functions or not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from imports(child, in_functions=in_functions)


def rank(room: str) -> int:
    """Returns the place of a room in the flow; the shared top-level modules come first."""
    return len(FLOW) if room == "__main__.py" else FLOW.index(room) + 1 if room in FLOW else 0


def test_imports_point_left_along_the_flow() -> None:
    rooms = {path.parts[0] for path in TREES if len(path.parts) > 1}
    assert rooms <= set(FLOW)
    wrong = [
        f"{path} imports {name}"
        for path, tree in TREES.items()
        # The package's public names are imported lazily, from all rooms.
        if path.name != "__init__.py" or len(path.parts) > 1
        for name in imports(tree)
        if name.startswith(".")
        or (name.startswith("lic_drake.") and rank(name.split(".")[1]) > rank(path.parts[0]))
    ]
    assert wrong == []


def test_no_module_imports_itself_by_way_of_others() -> None:
    modules = {
        ".".join(("lic_drake", *path.with_suffix("").parts)).removesuffix(".__init__"): tree
        for path, tree in TREES.items()
    }
    graph = {
        name: {
            other
            for full in imports(tree, in_functions=False)
            for other in (full, full.rpartition(".")[0])
            # A package is imported before its modules; to them it is no dependency of its own.
            if other in modules and not f"{name}.".startswith(f"{other}.")
        }
        for name, tree in modules.items()
    }
    assert "lic_drake.errors" in graph["lic_drake.reach.scenario"]
    assert len(list(TopologicalSorter(graph).static_order())) == len(modules)  # Else CycleError.


def test_drake_is_imported_where_it_should_be() -> None:
    users = {
        str(path): {name for name in imports(tree) if name.startswith("pydrake")}
        for path, tree in TREES.items()
    }
    assert not any(names for path, names in users.items() if path.startswith("clutter"))
    assert not any(name.startswith("pydrake.all") for names in users.values() for name in names)


def test_modules_are_few_and_short() -> None:
    assert len(TREES) <= MAX_MODULES
    lines = {path: len((PACKAGE / path).read_text().splitlines()) for path in TREES}
    assert {path for path, count in lines.items() if count > MAX_LINES} == set()


@pytest.mark.parametrize("what", ["lic_drake", "lic_drake.cli.main"])
def test_an_import_takes_less_than_a_blink(what: str) -> None:
    # Time of work: on a busy machine, waiting for a core is not the package's fault.
    script = f"import time; t = time.process_time(); import {what}; print(time.process_time() - t)"
    assert float(output_of(script)) < MAX_IMPORT_S


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("lic_drake.cli.main", {"pydrake", "sklearn"}),
        ("lic_drake.clutter.registry", {"pydrake", "sklearn", "matplotlib", "pyarrow"}),
        ("lic_drake.estimate.registry", {"pydrake", "sklearn", "matplotlib"}),
        (
            "lic_drake.select.lic, lic_drake.reach.session",
            {"sklearn", "matplotlib", "distributed"},
        ),
        ("lic_drake.show.page", {"pydrake", "numpy", "matplotlib"}),
    ],
)
def test_modules_load_only_what_they_need(module: str, heavy: set[str]) -> None:
    script = f"import sys, {module}; print(*{{name.split('.')[0] for name in sys.modules}})"
    assert heavy & set(output_of(script).split()) == set()


def output_of(script: str) -> str:
    command = [sys.executable, "-c", script]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def lines_with(pattern: str, *except_in: str) -> list[str]:
    """Lines of the package that match a regular expression, but those of some rooms."""
    return [
        f"{path}: {line.strip()}"
        for path in TREES
        if path.parts[0] not in except_in
        for line in (PACKAGE / path).read_text(encoding="utf-8").splitlines()
        if re.search(pattern, line)
    ]


def test_only_robots_are_asked_what_kind_of_robot_they_are() -> None:
    assert lines_with(r"isinstance\(.*(Planar|Pr2|Pointing)", "robots") == []
    # Elsewhere the height of a torso is the third number of b0.
    assert len(lines_with("torso_m", "robots", "clutter")) < 20


def undocumented(tree: ast.Module) -> Iterator[str]:
    """Yields public names of a module that nothing is said about."""
    if not ast.get_docstring(tree):
        yield "the module"
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            if not ast.get_docstring(node):
                yield node.name
            for inner in node.body if isinstance(node, ast.ClassDef) else []:
                if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                    if not ast.get_docstring(inner):
                        yield f"{node.name}.{inner.name}"
        targets = [node.target] if isinstance(node, ast.AnnAssign) else []
        targets = node.targets if isinstance(node, ast.Assign) else targets
        names = [name.id for name in targets if isinstance(name, ast.Name)]
        said = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        yield from (name for name in names if not (said or name.startswith("_")))


def test_every_public_name_is_documented() -> None:
    missing = [f"{path}: {name}" for path, tree in TREES.items() for name in undocumented(tree)]
    assert missing == []


def test_nothing_that_is_read_can_be_executed_or_unpickled() -> None:
    forbidden = re.compile(
        r"\b(eval|exec|__import__|unsafe_load|yaml\.load|full_load)\(|allow_pickle"
        r"|^\s*(?:import|from) (?:pickle|marshal|shelve|joblib|cloudpickle)\b",
        re.MULTILINE,
    )
    found = {
        path.as_posix()
        for path in TREES
        if forbidden.search((PACKAGE / path).read_text(encoding="utf-8"))
    }
    # Messages between the collector and its own workers, no files.
    assert found <= {"experience/workers.py"}
