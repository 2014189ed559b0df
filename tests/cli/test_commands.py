"""What every subcommand owes its users, checked over the whole tree of parsers."""

import argparse
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import lic_drake
from lic_drake.cli.main import main, make_parser
from lic_drake.errors import LicError

UNITS = r"metre|degree|second|\brad\b|\bN\b|newton|probability|simulated reaches"


def tree(parser: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, str, object]]:
    """Yields name, one-line help and parser of every subcommand below a parser."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help for choice in action._choices_actions}
            for word, child in action.choices.items():
                yield f"{name} {word}", helps.get(word) or "", child
                yield from tree(child, f"{name} {word}")


COMMANDS = list(tree(make_parser(), "lic"))
LEAVES = [(name, parser) for name, _, parser in COMMANDS if parser.get_default("run")]
names = [name for name, _ in LEAVES]


def arguments(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    left_out = (argparse._HelpAction, argparse._SubParsersAction)
    return [action for action in parser._actions if not isinstance(action, left_out)]


@pytest.mark.parametrize(("name", "line", "parser"), COMMANDS, ids=[c[0] for c in COMMANDS])
def test_it_says_what_it_does_in_one_line_and_at_length_and_gives_an_example(
    name: str, line: str, parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 15 <= len(line) <= 75
    assert line[0].islower() and not line.endswith(".")
    assert parser.description and parser.description[0].isupper()
    assert parser.description.endswith(".")
    assert parser.epilog is not None
    example = parser.epilog.removeprefix("example: ")
    assert example.startswith(name)
    assert callable(make_parser().parse_args(shlex.split(example)[1:]).run)
    with pytest.raises(SystemExit) as end:
        main([*name.split()[1:], "--help"])
    assert end.value.code == 0
    assert " ".join(parser.epilog.split()) in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("name", "parser"), LEAVES, ids=names)
def test_every_argument_says_what_it_is_with_default_and_unit(
    name: str, parser: argparse.ArgumentParser
) -> None:
    for action in arguments(parser):
        text = (action.help or "") % vars(action) if action.help else ""
        what, _, default = text.partition("default: ")
        assert len(what.strip(" (")) >= 5, action.dest
        if action.option_strings:
            assert default or "no default" in what, action.dest
            assert all(option.startswith("--") for option in action.option_strings)
        if isinstance(action.default, int | float) and not isinstance(action.default, bool):
            assert f"{action.default:g}" in text, action.dest
        if action.type is float:
            assert re.search(UNITS, text), action.dest
        if action.option_strings and action.nargs != 0:
            assert action.metavar or action.choices or action.dest == "out", action.dest


@pytest.mark.parametrize(("name", "parser"), LEAVES, ids=names)
def test_a_wrong_option_is_named_with_how_to_use_it(
    name: str, parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main([*name.split()[1:], "--no-such-option"])
    assert end.value.code == 2
    output, error = capsys.readouterr()
    assert output == ""
    assert error.startswith(f"usage: {name}")


def test_what_a_machine_may_read_comes_as_json() -> None:
    with_json = {name for name, parser in LEAVES if "--json" in parser._option_string_actions}
    assert with_json == {
        *("lic reach", "lic select", "lic collect", "lic evaluate", "lic gallery", "lic bench"),
        "lic fit",
        *("lic experience info", "lic experience check", "lic robot check", "lic train"),
    }


WRONG = [
    ("demo --method jungle", "'jungle'; choose one of rnd"),
    (
        "demo --robot planar-arm --category sphere-aperture-clutter",
        "is an arm in the plane; choose",
    ),
    ("demo --robot iiwa14 --library cylinder-clutter", "is for --robot planar-arm, not iiwa14"),
    ("demo --robot jungle", "choose one of planar-arm, pr2"),
    ("train {none} --robot jungle --minutes 1", "choose one of planar-arm, pr2"),
    ("demo --visuals drake_models", "is for --robot pr2, not planar-arm; omit it"),
    ("demo --library {none}", "make one with: lic collect"),
    ("explore jungle", "choose one of cylinder-aperture-clutter"),
    ("replay jungle 0", "no experience library at jungle"),
    ("reach --scenario jungle", "shipped scenarios: "),
    ("reach --goal 5 0", "choose a nearer goal"),
    ("reach --goal nan 0", "finite"),
    ("reach --environment 4294967296", "from 0 to"),
    ("reach --stream jungle", "choose one of training"),
    ("reach --set {{mpc:", "not YAML"),
    ("reach --record {file}/a.html", "cannot write into"),
    ("select --goal 0.6 0.1 --method jungle", "choose one of"),
    ("select --goal 0.6 0.1 --library {none}", "make one with: lic collect"),
    ("select --goal inf 0.1", "finite"),
    ("fit {file} --decide a --given b", "from a .csv or .parquet file"),
    ("collect {file}/below", "cannot create the folder"),
    ("collect {none} --share 3/2", "share"),
    ("collect {none} --environments 0", "from 1 to"),
    ("experience info {none}", "make one with: lic collect"),
    ("experience check {none}", "make one with: lic collect"),
    ("experience recompute {none}", "make one with: lic collect"),
    ("experience add {none} {file} --source lab", ".csv or .parquet"),
    ("experience merge {file}/new.parquet {none}", "no experience library"),
    ("evaluate {none} --methods jungle", "choose one of"),
    (
        "evaluate {none} --library passage-clutter --methods cost --goals 2 --set {short}",
        "offers 1 goal, 2 were asked for",
    ),
    ("evaluate {none} --library {none}", "make one with: lic collect"),
    ("gallery {file}", "cannot write into"),
    ("gallery {none} --method jungle", "choose one of"),
    ("gallery {none} --library {file}", "damaged or not a Parquet file"),
    ("robot check jungle", "choose one of planar-arm, pr2, iiwa14, panda"),
    ("bench reach --scenario jungle", "shipped scenarios: "),
]


@pytest.mark.usefixtures("_here")
@pytest.mark.parametrize(("command", "said"), WRONG)
def test_a_users_mistake_is_one_line_that_says_what_to_do(
    command: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("no library")
    places = {"none": tmp_path / "none", "file": tmp_path / "file"}
    places["short"] = '{"stop":{"timeout_s":0.04}}'
    assert main([word.format(**places) for word in command.split()]) == 2
    output, error = capsys.readouterr()
    assert output == "" and error.endswith("\n")
    line = error.splitlines()[-1]
    assert line.startswith("lic: error: ") and said in line


def test_every_subcommand_is_tried_with_a_mistake() -> None:
    assert all(any(f"lic {c}".startswith(name) for c, _ in WRONG) for name in names)


def strict_json(text: str) -> dict[str, object]:
    """Reads a single object; NaN is not JSON."""

    def refuse(word: str) -> None:
        raise ValueError(word)

    values = json.loads(text, parse_constant=refuse)
    assert isinstance(values, dict)
    return values


def test_collecting_and_looking_at_it_as_json(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["collect", str(library), "--json"]) == 0
    values = strict_json(capsys.readouterr().out)
    assert (values["total"], values["done"], values["new"]) == (36, 36, 0)
    assert values["failed"] == {}
    for action in ("info", "check"):
        assert main(["experience", action, str(library), "--json"]) == 0
        assert strict_json(capsys.readouterr().out)["reaches"] == 36


@pytest.mark.usefixtures("_here")
def test_an_evaluation_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["evaluate", str(tmp_path / "new"), "--methods", "rnd", "cost", "--json"]
    small = ["--environments", "2", "--attempts", "1", "--workers", "1"]
    assert main([*command, *small]) == 0
    output, error = capsys.readouterr()
    rates = strict_json(output)["rates"]
    assert [(rate["method"], rate["trials"]) for rate in rates] == [("cost", 2), ("rnd", 2)]
    assert [rate["p_value"] is None for rate in rates] == [False, True]
    assert "2/2 environments" in error


def test_python_m_lic_drake_is_the_command() -> None:
    command = [sys.executable, "-m", "lic_drake", "--version"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout == f"lic {lic_drake.__version__}\n"


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
    with subprocess.Popen(
        [sys.executable, "-m", "lic_drake", "experience", "info", str(library)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 141
