import subprocess
import sys
from pathlib import Path

import pytest

import lic_drake
from lic_drake.cli import main as dut
from lic_drake.cli.main import main
from lic_drake.errors import LicError


def _lic(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "lic_drake", *arguments], capture_output=True, text=True
    )


def test_python_m_lic_drake_is_the_command() -> None:
    result = _lic("--version")
    assert result.stdout == f"lic {lic_drake.__version__}\n"
    assert result.returncode == 0


def test_help_lists_every_subcommand(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    for module in dut.SUBCOMMANDS:
        assert f"\n    {module.__name__.rpartition('.')[2]}" in text


def test_a_users_mistake_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    result = _lic("experience", "info", str(tmp_path / "none"))
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith("lic: error: no experience library at ")
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (LicError("two\n  lines"), 2, "lic: error: two lines\n"),
        (KeyboardInterrupt(), 130, "lic: interrupted\n"),
    ],
)
def test_errors_of_a_subcommand_end_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    code: int,
    message: str,
) -> None:
    def fail(_: object) -> int:
        raise error

    monkeypatch.setattr("lic_drake.cli.experience.run_info", fail)
    assert main(["experience", "info", "library"]) == code
    assert capsys.readouterr().err == message


def test_a_reader_that_goes_away_is_no_error(library: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "lic_drake", "experience", "info", str(library)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    assert process.wait() == 141
    process.stderr.close()


def test_the_command_line_loads_nothing_heavy() -> None:
    script = (
        "import sys, lic_drake.cli.main as m\n"
        "heavy = {'numpy', 'pyarrow', 'pydrake', 'scipy', 'sklearn', 'tqdm', 'yaml'}\n"
        "print(sorted(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (result.stdout.strip(), result.stderr) == ("[]", "")
