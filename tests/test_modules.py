"""The package as a whole: light to import, without cycles, every public name documented."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import lic_drake

PACKAGE = Path(lic_drake.__file__).parent
MAX_IMPORT_S = 0.3

NAME_NEEDS_NO_WORDS = ("Vector",)
"""Aliases of one type that say all."""


def module_name(path: Path, package: Path) -> str:
    parts = (package.name, *path.relative_to(package).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def runtime_imports(node: ast.AST) -> Iterator[str]:
    """Yields what is imported when a module is: not in functions, nor for type checkers."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom) and child.module:
            yield child.module
            yield from (f"{child.module}.{alias.name}" for alias in child.names)
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            yield from runtime_imports(ast.Module(child.orelse, []))
        elif not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from runtime_imports(child)


def import_graph(package: Path) -> dict[str, set[str]]:
    """Module -> modules of the package that it imports when it is imported."""
    trees = {
        module_name(path, package): ast.parse(path.read_text(encoding="utf-8"))
        for path in package.rglob("*.py")
    }
    # A package is imported before its modules; to them it is no dependency of its own.
    return {
        name: {
            other
            for other in runtime_imports(tree)
            if other in trees and not f"{name}.".startswith(f"{other}.")
        }
        for name, tree in trees.items()
    }


def find_cycle(graph: dict[str, set[str]]) -> list[str]:
    """Returns modules that import each other in a ring, if there are any."""
    done: set[str] = set()

    def visit(name: str, way: list[str]) -> list[str]:
        if name in way:
            return way[way.index(name) :]
        if name in done:
            return []
        for other in sorted(graph[name]):
            if cycle := visit(other, [*way, name]):
                return cycle
        done.add(name)
        return []

    return next(filter(None, (visit(name, []) for name in sorted(graph))), [])


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = import_graph(PACKAGE)
    assert len(graph) > 100
    assert "lic_drake.errors" in graph["lic_drake.reach.scenario"]
    assert find_cycle(graph) == []


def test_a_cycle_is_found_and_one_for_type_checkers_is_none(tmp_path: Path) -> None:
    package = tmp_path / "p"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text("from p.b import x\n")
    (package / "b.py").write_text("from p import c\n")
    (package / "c.py").write_text("if TYPE_CHECKING:\n    import p.a\ndef f():\n    import p.a\n")
    assert find_cycle(import_graph(package)) == []
    (package / "c.py").write_text("class C:\n    import p.a\n")
    assert find_cycle(import_graph(package)) == ["p.a", "p.b", "p.c"]


@pytest.mark.parametrize("what", ["lic_drake", "lic_drake.cli.main"])
def test_an_import_takes_less_than_a_blink(what: str) -> None:
    # Time of work: on a busy machine, waiting for a core is not the package's fault.
    script = f"import time; t = time.process_time(); import {what}; print(time.process_time() - t)"
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert float(result.stdout) < MAX_IMPORT_S


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("lic_drake.clutter.registry", {"pydrake", "sklearn", "matplotlib", "pyarrow"}),
        ("lic_drake.estimate.registry", {"pydrake", "sklearn", "matplotlib"}),
        ("lic_drake.experience.workers", {"pydrake", "numpy", "pyarrow", "sklearn"}),
        ("lic_drake.select.lic", {"sklearn", "matplotlib", "distributed"}),
        ("lic_drake.reach.rollout", {"sklearn", "matplotlib", "distributed"}),
        ("lic_drake.show.page", {"pydrake", "numpy", "matplotlib"}),
    ],
)
def test_modules_load_only_what_they_need(module: str, heavy: set[str]) -> None:
    script = f"import sys, {module}; print(*{{name.split('.')[0] for name in sys.modules}})"
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert heavy & set(result.stdout.split()) == set()


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
        for name in names:
            if not (said or name.startswith("_") or name in NAME_NEEDS_NO_WORDS):
                yield name


def test_every_public_name_is_documented() -> None:
    missing = [
        f"{path.relative_to(PACKAGE).as_posix()}: {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for name in undocumented(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert missing == []


def test_a_name_without_a_word_is_found() -> None:
    text = '"""A module."""\nA = 1\n"""One."""\nB = 2\ndef f(): ...\n'
    text += 'class C:\n    """C."""\n    def g(self): ...\n'
    assert list(undocumented(ast.parse(text))) == ["B", "f", "C.g"]


def test_nothing_that_is_read_can_be_executed_or_unpickled() -> None:
    forbidden = re.compile(
        r"\b(eval|exec|__import__|unsafe_load|yaml\.load|full_load)\(|allow_pickle"
        r"|^\s*(?:import|from) (?:pickle|marshal|shelve|joblib|cloudpickle)\b",
        re.MULTILINE,
    )
    found = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if forbidden.search(path.read_text(encoding="utf-8"))
    }
    # Messages between the collector and its own workers, no files.
    assert found <= {"experience/cluster.py"}
