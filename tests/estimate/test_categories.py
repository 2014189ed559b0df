import pytest

from lic_drake.estimate import categories
from lic_drake.estimate.categories import features_of, register_features
from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1

NAMES = ("cylinder-clutter", "passage-clutter", "cylinder-aperture-clutter")


@pytest.mark.parametrize("name", NAMES)
def test_the_second_reach_knows_what_the_first_does_and_where_it_started(name: str) -> None:
    features = features_of(name)
    assert features.first == PLANAR_LIC1
    assert features.second.goal == features.first.goal
    assert features.second.start == features.first.start
    assert {"first_start_y", "first_start_phi"} <= set(features.second.observed)


def test_observations_are_the_paper_s() -> None:
    seen = {
        name: set(features_of(name).second.observed) - {"first_start_y", "first_start_phi"}
        for name in NAMES
    }
    assert seen == {
        "cylinder-clutter": {"first_final_x", "first_final_y"},
        "passage-clutter": {"first_final_vx", "first_final_vy"},
        "cylinder-aperture-clutter": set(),
    }


def test_in_space_the_first_start_is_its_place_across_x() -> None:
    features = features_of("sphere-aperture-clutter")
    assert features.first == SPACE_LIC1
    assert (features.second.goal, features.second.start) == (SPACE_LIC1.goal, SPACE_LIC1.start)
    assert set(features.second.observed) == {"first_start_y", "first_start_z"}


def test_a_category_can_be_added_by_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(categories._CATEGORIES, "entries", dict(categories._CATEGORIES.entries))
    register_features("foliage", PLANAR_LIC1, ("first_start_y",))
    assert features_of("foliage").second.observed == ("first_start_y",)


def test_an_unknown_category_is_named_with_the_known_ones() -> None:
    with pytest.raises(EstimateError, match=r"'foliage'.*cylinder-clutter"):
        features_of("foliage")
