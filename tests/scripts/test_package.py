import re
from pathlib import Path

import lic_drake


def test_the_package_does_not_need_the_scripts() -> None:
    for path in Path(lic_drake.__file__).parent.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"^\s*(from|import) scripts\b", text, re.MULTILINE), path
