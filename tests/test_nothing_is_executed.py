"""Nothing that the package reads is executed or unpickled."""

import ast
from pathlib import Path

import lic_drake

PACKAGE = Path(lic_drake.__file__).parent
EXECUTES = {"eval", "exec", "compile", "__import__"}
UNPICKLES = {"pickle", "marshal", "shelve", "dill", "joblib", "cloudpickle"}
ALLOWED = {
    # Messages between the collector and its own workers, no files.
    "experience/cluster.py": {"pickle"},
    # The user's own modules, which an environment variable names.
    "extensions.py": {"import_module"},
}


def test_nothing_that_is_read_can_be_executed_or_unpickled() -> None:
    found = []
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            words: set[str] = set()
            if isinstance(node, ast.Import):
                words = {alias.name.split(".")[0] for alias in node.names} & UNPICKLES
            elif isinstance(node, ast.ImportFrom):
                words = {(node.module or "").split(".")[0]} & UNPICKLES
            elif isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                if called in EXECUTES or called.endswith(("import_module", "unsafe_load")):
                    words = {called}
                if called in ("yaml.load", "yaml.full_load") and name != "yaml_text.py":
                    words = {called}
                if any(keyword.arg == "allow_pickle" for keyword in node.keywords):
                    words = {"allow_pickle"}
            found += [f"{name}: {word}" for word in words - ALLOWED.get(name, set())]
    assert found == []
