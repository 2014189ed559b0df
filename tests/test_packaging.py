"""The rules that keep the package installable from its metadata and its files."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import lic_drake
from lic_drake.paths import models_dir

CHECKOUT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]

IMPORT_NAMES = {
    "drake": "pydrake",
    "pillow": "PIL",
    "pyyaml": "yaml",
    "scikit-image": "skimage",
    "scikit-learn": "sklearn",
}


def imported(node: ast.AST, *, in_functions: bool) -> set[str]:
    """Returns the names of the top-level packages that are imported below a node."""
    found = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            found |= {alias.name.split(".")[0] for alias in child.names}
        elif isinstance(child, ast.ImportFrom):
            found.add((child.module or "").split(".")[0])
        if in_functions or not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            found |= imported(child, in_functions=in_functions)
    return found


def declared(*requirements: str) -> set[str]:
    """Returns the import names of declared requirements."""
    names = {Requirement(text).name for text in requirements}
    return {IMPORT_NAMES.get(name, name.replace("-", "_")) for name in names}


def test_the_floors_keep_out_leaking_drake_versions_and_set_no_ceiling() -> None:
    requirements = {r.name: r.specifier for r in map(Requirement, PROJECT["dependencies"])}
    python = SpecifierSet(PROJECT["requires-python"])
    drakes = ["1.51.1", "1.55.0", "1.56.0", "1.99.0"]
    assert list(requirements["drake"].filter(drakes)) == ["1.56.0", "1.99.0"]
    assert list(python.filter(["3.11.13", "3.12.0", "3.14.0"])) == ["3.12.0", "3.14.0"]


def test_metadata_name_the_package_s_version_and_its_command() -> None:
    assert lic_drake.__version__ == PROJECT["version"]
    module, _, function = PROJECT["scripts"]["lic"].partition(":")
    assert callable(getattr(import_module(module), function))


def test_modules_import_only_declared_distributions() -> None:
    # mpl_toolkits is a part of matplotlib.
    known = {"lic_drake", *sys.stdlib_module_names, *declared(*PROJECT["dependencies"])}
    known |= {"mpl_toolkits"}
    extras = declared(*(r for rs in PROJECT["optional-dependencies"].values() for r in rs))
    undeclared = []
    for path in (CHECKOUT / "lic_drake").rglob("*.py"):
        tree = ast.parse(path.read_text())
        wrong = imported(tree, in_functions=False) - known
        wrong |= imported(tree, in_functions=True) - known - extras
        undeclared += [f"{path.name} imports {name}" for name in wrong]
    assert undeclared == []


def test_the_models_folder_is_the_checkouts_own_and_has_scenarios() -> None:
    assert models_dir() == CHECKOUT / "models"
    assert list((models_dir() / "scenarios").glob("*.yaml"))


def test_pages_link_to_files_that_exist() -> None:
    pages = [p for p in CHECKOUT.rglob("*.md") if not {".venv", "out"} & set(p.parts)]
    assert len(pages) > 20
    for page in pages:
        for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page}: {link}"
    architecture = (CHECKOUT / "lic_drake" / "README.md").read_text(encoding="utf-8")
    files = {path.name for path in CHECKOUT.rglob("*.py")} | {"paper.yaml", "pyproject.toml"}
    named = re.findall(r"`(?:[\w/]+/)?(\w+\.(?:py|yaml))`", architecture)
    assert set(named) <= files


def test_no_file_in_models_is_ignored_by_git(tmp_path: Path) -> None:
    # An ignored file is missing from every clone, and hatchling leaves it out of the wheel.
    if shutil.which("git") is None:
        pytest.skip("git is missing: apt-get install git")
    git = ["git", "-C", str(tmp_path), "-c", "core.excludesFile="]
    subprocess.run([*git, "init", "--quiet"], check=True)
    shutil.copy(CHECKOUT / ".gitignore", tmp_path)
    models = [p.relative_to(CHECKOUT).as_posix() for p in models_dir().rglob("*") if p.is_file()]
    result = subprocess.run(
        [*git, "check-ignore", "--no-index", "--stdin"],
        input="\n".join(models),
        capture_output=True,
        text=True,
    )
    assert result.stdout == ""
