"""The rules that keep the package installable, light to import and readable from left to right."""

import ast
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import lic_drake
from lic_drake.paths import models_dir

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = CHECKOUT / "lic_drake"
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
MAX_LINES = 400
FLOW = (
    "clutter",
    "robots",
    "scene",
    "control",
    "reach",
    "experience",
    "estimate",
    "select",
    "perception",
    "evaluate",
    "show",
    "cli",
)
"""Rooms from left to right; a module imports only from its own room and from rooms to its left."""

IMPORT_NAMES = {
    "drake": "pydrake",
    "pillow": "PIL",
    "scikit-image": "skimage",
    "scikit-learn": "sklearn",
}
BROUGHT_BY_DRAKE = {"matplotlib", "mpl_toolkits", "pydot", "yaml"}


def _sources(package: Path) -> list[Path]:
    return sorted(package.rglob("*.py"))


def _imports(node: ast.AST, *, in_functions: bool = True) -> Iterator[str]:
    """Yields the dotted name of every module (or member of a package) imported below a node."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (alias.name for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            origin = "." * child.level + (child.module or "")
            yield from (f"{origin}.{alias.name}" for alias in child.names)
        if in_functions or not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _imports(child, in_functions=in_functions)


def _rank(parts: tuple[str, ...]) -> int:
    """Place of a module in the flow; the shared modules at the top level come before all rooms.

    Args:
        parts: The module's names below the package, for instance ("scene", "contact").
    """
    room = parts[0] if parts else ""
    if room == "__main__":
        return len(FLOW)
    if room in FLOW:
        return FLOW.index(room) + 1
    return 0


def _wrong_imports(package: Path) -> list[str]:
    """Returns every import that is relative or points right, as "file imports module"."""
    wrong = []
    for path in _sources(package):
        relative = path.relative_to(package)
        allowed = _rank(relative.with_suffix("").parts)
        for name in _imports(ast.parse(path.read_text())):
            root, *parts = name.split(".")
            if root == "" or (root == package.name and _rank(tuple(parts)) > allowed):
                wrong.append(f"{relative.as_posix()} imports {name}")
    return wrong


def _declared(*requirements: str) -> set[str]:
    """Returns the import names of declared requirements."""
    names = {Requirement(text).name for text in requirements}
    return {IMPORT_NAMES.get(name, name.replace("-", "_")) for name in names}


def test_the_floors_keep_out_leaking_drake_versions_and_set_no_ceiling() -> None:
    requirements = {r.name: r.specifier for r in map(Requirement, PROJECT["dependencies"])}
    python = SpecifierSet(PROJECT["requires-python"])
    assert list(requirements["drake"].filter(["1.51.1", "1.55.0", "1.56.0", "1.99.0"])) == [
        "1.56.0",
        "1.99.0",
    ]
    assert list(python.filter(["3.11.13", "3.12.0", "3.14.0"])) == ["3.12.0", "3.14.0"]


def test_the_version_is_the_same_in_the_package_and_its_metadata() -> None:
    assert lic_drake.__version__ == PROJECT["version"]


def test_the_lic_command_points_to_a_function() -> None:
    module, _, function = PROJECT["scripts"]["lic"].partition(":")
    assert callable(getattr(import_module(module), function))


def test_modules_import_only_declared_distributions() -> None:
    runtime = _declared(*PROJECT["dependencies"]) | BROUGHT_BY_DRAKE
    known = {"lic_drake", *sys.stdlib_module_names, *runtime}
    extras = _declared(*(r for rs in PROJECT["optional-dependencies"].values() for r in rs))
    undeclared = []
    for path in _sources(PACKAGE):
        tree = ast.parse(path.read_text())
        at_top = {name.split(".")[0] for name in _imports(tree, in_functions=False)}
        anywhere = {name.split(".")[0] for name in _imports(tree)}
        for name in sorted((at_top - known) | (anywhere - known - extras)):
            undeclared.append(f"{path.relative_to(PACKAGE)} imports {name}")
    assert undeclared == []


def test_every_room_has_a_place_in_the_flow() -> None:
    rooms = {path.relative_to(PACKAGE).parts[0] for path in PACKAGE.rglob("*/*.py")}
    assert rooms - set(FLOW) == set()


def test_imports_point_left_along_the_flow() -> None:
    assert _wrong_imports(PACKAGE) == []


def test_an_import_that_points_right_is_found(tmp_path: Path) -> None:
    package = tmp_path / "lic_drake"
    lines = {
        "errors.py": "import lic_drake.seeds\nimport lic_drake.clutter.disc\n",
        "scene/board.py": "from lic_drake.robots import arm\nfrom lic_drake.reach import task\n",
        "clutter/disc.py": "def f():\n    from lic_drake import scene\n",
        "select/lic.py": "from ..errors import LicError\n",
        "cli/main.py": "from lic_drake.evaluate.trial import run\n",
    }
    for name, text in lines.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    assert _wrong_imports(package) == [
        "clutter/disc.py imports lic_drake.scene",
        "errors.py imports lic_drake.clutter.disc",
        "scene/board.py imports lic_drake.reach.task",
        "select/lic.py imports ..errors.LicError",
    ]


def test_clutter_knows_no_drake() -> None:
    users = [
        path.name
        for path in _sources(PACKAGE / "clutter")
        if any(n.startswith("pydrake") for n in _imports(ast.parse(path.read_text())))
    ]
    assert users == []


def test_modules_take_names_from_drakes_own_modules_and_not_from_pydrake_all() -> None:
    users = [
        str(path.relative_to(PACKAGE))
        for path in _sources(PACKAGE)
        if any(n.startswith("pydrake.all") for n in _imports(ast.parse(path.read_text())))
    ]
    assert users == []


def test_no_module_is_longer_than_400_lines() -> None:
    lines = {
        str(p.relative_to(PACKAGE)): len(p.read_text().splitlines()) for p in _sources(PACKAGE)
    }
    assert {name for name, count in lines.items() if count > MAX_LINES} == set()


def test_importing_the_package_and_its_command_loads_neither_drake_nor_scikit_learn() -> None:
    script = (
        "import sys, lic_drake, lic_drake.cli.main\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'pydrake', 'sklearn'}))"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (result.stdout.strip(), result.stderr) == ("[]", "")


def test_the_models_folder_is_the_checkouts_own_and_has_scenarios() -> None:
    assert models_dir() == CHECKOUT / "models"
    assert list((models_dir() / "scenarios").glob("*.yaml"))


def test_no_file_in_models_is_ignored_by_git(tmp_path: Path) -> None:
    # An ignored file is missing from every clone, and hatchling leaves it out of the wheel.
    if shutil.which("git") is None:
        pytest.skip("git is missing: apt-get install git")
    git = ["git", "-C", str(tmp_path), "-c", "core.excludesFile="]
    subprocess.run([*git, "init", "--quiet"], check=True)
    shutil.copy(CHECKOUT / ".gitignore", tmp_path)
    models = [p.relative_to(CHECKOUT).as_posix() for p in models_dir().rglob("*") if p.is_file()]
    names = "\n".join([*models, "models/experience/x.partial.jsonl"])
    result = subprocess.run(
        [*git, "check-ignore", "--no-index", "--stdin"], input=names, capture_output=True, text=True
    )
    assert result.stdout.splitlines() == ["models/experience/x.partial.jsonl"]
