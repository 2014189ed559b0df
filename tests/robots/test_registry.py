import pytest

from lic_drake.errors import ScenarioError
from lic_drake.robots import registry
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.registry import get_robot, register_robot


def test_the_planar_arm_is_known_and_read_once() -> None:
    assert get_robot("planar-arm") is planar_arm() is get_robot("planar-arm")


def test_an_unknown_robot_is_named_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError, match=r"'hexapod'.*planar-arm"):
        get_robot("hexapod")


def test_a_robot_can_be_added_by_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry._ROBOTS, "entries", dict(registry._ROBOTS.entries))
    register_robot("another-arm", planar_arm)
    assert get_robot("another-arm") is planar_arm()
