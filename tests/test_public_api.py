"""The public names: complete, documented, and imported only when they are used."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import lic_drake

README = Path(__file__).parents[1] / "README.md"


def test_importing_the_package_imports_nothing_heavy():
    code = (
        "import sys, lic_drake; dir(lic_drake);"
        "print(sorted({'pydrake', 'sklearn', 'scipy', 'numpy', 'pyarrow'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize("name", [n for n in lic_drake.__all__ if n != "__version__"])
def test_public_names_exist_and_are_documented(name):
    assert len(getattr(lic_drake, name).__doc__) > 20
    assert name in dir(lic_drake)


def test_names_for_type_checkers_are_those_that_are_imported_lazily():
    (guard,) = (
        node
        for node in ast.parse(Path(lic_drake.__file__).read_text("utf-8")).body
        if isinstance(node, ast.If)
    )
    homes = {
        alias.name: node.module.removeprefix("lic_drake.")
        for node in guard.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert homes == lic_drake._HOMES


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="no attribute 'reach_everything'"):
        lic_drake.reach_everything  # noqa: B018


def test_the_readmes_example_prints_what_the_readme_says(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    exec(compile(example, "README", "exec"), {})
    outcomes = [line.split()[-1] for line in capsys.readouterr().out.splitlines()]
    assert outcomes == ["force", "reached"]
