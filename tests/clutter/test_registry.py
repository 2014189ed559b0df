import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from lic_drake.clutter import registry
from lic_drake.clutter.instance import ClutterInstance, make_objects
from lic_drake.clutter.registry import category_names, get_category, register_category
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import parse_scenario


@dataclasses.dataclass(kw_only=True)
class OneSphere:
    """A category as a user would add it."""

    radius_m: float = 0.05

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        return make_objects("sphere", [self.radius_m], rng.uniform(0.4, 0.8, 2), movable=True)


@pytest.fixture
def _restore(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(registry._CATEGORIES, "entries", dict(registry._CATEGORIES.entries))
    yield


@pytest.mark.usefixtures("_restore")
def test_a_category_added_by_one_call_can_be_used_in_a_scenario() -> None:
    register_category("one-sphere", OneSphere)
    scenario = parse_scenario(
        "{category: one-sphere, robot: planar-arm, clutter: {radius_m: 0.03}}"
    )
    instance = scenario.sample_instance("training", 0)
    assert instance.size[0, 0] == 0.03
    assert "one-sphere" in category_names()
    with pytest.raises(ScenarioError, match=r"'jungle'.*cylinder-clutter"):
        get_category("jungle")
