import importlib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(
    ".".join(path.relative_to(CHECKOUT).with_suffix("").parts)
    for path in (CHECKOUT / "scripts").glob("*/*.py")
)


@pytest.mark.parametrize("module", SCRIPTS)
def test_every_script_finds_what_it_imports(module: str) -> None:
    if module.startswith("scripts.mujoco"):
        pytest.importorskip("mujoco")
    importlib.import_module(module)
