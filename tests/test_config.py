"""Checks of configurations, and what is refused when one is read."""

import dataclasses
import math
from pathlib import Path

import pytest

from lic_drake.config import MAX_YAML_BYTES, check_numbers, merge, read_mapping, read_section
from lic_drake.errors import RequestError, ScenarioError


@dataclasses.dataclass(kw_only=True)
class Part:
    size_m: float = 1.0

    def __post_init__(self) -> None:
        check_numbers(self, positive=["size_m"])


@dataclasses.dataclass(kw_only=True)
class Config:
    number: int = 3
    share: float = 0.5
    limit: float = math.inf
    lower: list[float] = dataclasses.field(default_factory=lambda: [0.0, 1.0])
    upper: list[float] = dataclasses.field(default_factory=lambda: [2.0, 3.0])
    part: Part = dataclasses.field(default_factory=Part)

    def __post_init__(self) -> None:
        check_numbers(
            self,
            non_negative=["number"],
            ranges={"share": (0.0, 1.0), "limit": (0.0, math.inf)},
            vectors={"lower": 2, "upper": 2},
            ascending=[("lower", "upper")],
        )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("number: -1", "number must be 0 or a positive number, got -1"),
        ("limit: .nan", "limit must be from 0 to inf, got nan"),
        ("lower: [1.0]", r"lower must be 2 finite numbers, got \[1.0\]"),
        ("lower: [0.0, 4.0]", "lower must not exceed upper"),
        ("part: {size_m: 0.0}", "size_m must be a positive number, got 0.0"),
        ("part: {size: 1.0}", "size"),
        ("colour: red", "colour"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(text: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=f"mine: .*{said}") as caught:
        read_section(Config, read_mapping(text, "mine"), "mine")
    assert "\n" not in str(caught.value)


def test_a_section_has_its_values_and_the_defaults_of_the_rest() -> None:
    defaults = Config(number=7)
    section = read_section(Config, {"part": {"size_m": 2.0}}, "mine", defaults)
    assert section == Config(number=7, part=Part(size_m=2.0))
    assert read_section(Config, None, "mine") == Config()
    assert defaults == Config(number=7)
    with pytest.raises(RequestError, match="number"):
        check_numbers(Config(), ranges={"number": (0, 2)}, error=RequestError)


def test_mappings_are_merged_level_by_level() -> None:
    base = {"a": {"b": 1, "c": 2}, "d": [1, 2]}
    assert merge(base, {"a": {"c": 3}, "d": [4]}) == {"a": {"b": 1, "c": 3}, "d": [4]}
    assert base == {"a": {"b": 1, "c": 2}, "d": [1, 2]}


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "[1, 2]",
        b"\xff\xfe\x00",
        "[" * 10_000,
        "a: !!python/object/apply:pathlib.Path.touch ['{touched}']",
        "a: " + "x" * MAX_YAML_BYTES,
    ],
    ids=range(6),
)
def test_what_is_no_plain_mapping_is_refused_and_does_nothing(
    text: str | bytes, tmp_path: Path
) -> None:
    touched = tmp_path / "touched"
    if isinstance(text, str):
        text = text.replace("{touched}", str(touched))
    with pytest.raises(ScenarioError, match="mine: ") as caught:
        read_mapping(text, "mine")
    assert "\n" not in str(caught.value)
    assert not touched.exists()
    assert read_mapping("", "mine") == {}
