import runpy
import sys
from pathlib import Path

import pytest
from trial_rows import fill_records

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.mark.parametrize("name", ["1_cylinder", "2_t_tests", "3_passage", "4_aperture"])
def test_each_table_has_its_script(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = fill_records(tmp_path / "results")
    script = SCRIPTS / f"table_{name}.py"
    monkeypatch.setattr(sys, "argv", [script.name, "--results", str(results)])
    with pytest.raises(SystemExit) as caught:
        runpy.run_path(str(script), run_name="__main__")
    assert caught.value.code == 0
    written = sorted(path.name for path in (results / "tables").iterdir())
    assert written == [f"table_{name[0]}.md", f"table_{name[0]}.tex"]
