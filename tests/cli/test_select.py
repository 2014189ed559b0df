import json

import pytest

from lic_drake.cli.main import main

SELECT = ["select", "--goal", "0.6", "0.1", "--category"]
BOTH = ["cylinder-clutter=0.5", "passage-clutter=0.5"]


@pytest.mark.slow
def test_a_failure_tells_of_which_category_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    # Straight ahead the arm comes through cylinders, but seldom through a passage that leans.
    assert main([*SELECT, *BOTH, "--json", "--failed", "0.1", "0"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    assert sum(chosen["categories"].values()) == pytest.approx(1.0)
    assert chosen["categories"]["passage-clutter"] > 0.6
    assert chosen["method"] == "mixture of gp"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cylinder-clutter=0.5", "passage-clutter=0.6"], "add up to 1"),
        (["cylinder-clutter"], "--category needs NAME=P with a number P"),
        (["fog=1"], "no library of 'fog' is shipped"),
        ([*BOTH, "--library", "out"], "leave out --library"),
        (["cylinder-clutter=0.5", "sphere-aperture-clutter=0.5"], "have other arms or start lines"),
    ],
)
def test_what_is_no_mixture_is_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*SELECT, *arguments]) != 0
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
