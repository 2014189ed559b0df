import sys
from pathlib import Path

import pytest
from support.trial_rows import fill_records

from scripts.tables import figures as make_figures


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["make_figures.py", *map(str, arguments)])
    return make_figures.main()


def test_figures_are_written_as_png_and_pdf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = fill_records(tmp_path / "results")
    names = ["success_cylinder-clutter", "learning_curve"]
    assert run(monkeypatch, *names, "--results", results) == 0
    written = {path.name for path in (results / "figures").iterdir()}
    assert written == {f"{name}.{suffix}" for name in names for suffix in ("png", "pdf")}
    assert (results / "figures" / "learning_curve.pdf").read_bytes().startswith(b"%PDF")


def test_what_cannot_be_drawn_does_not_stop_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    results = fill_records(tmp_path / "results")
    (results / "passage-clutter" / "trials.parquet").unlink()
    names = ["success_passage-clutter", "success_cylinder-clutter"]
    assert run(monkeypatch, *names, "--results", results) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: no trials at")
    assert captured.out.splitlines() == [str(results / "figures" / f"{names[1]}.png")]


def test_an_unknown_figure_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        run(monkeypatch, "figure_9")
    assert "invalid choice: 'figure_9'" in capsys.readouterr().err
