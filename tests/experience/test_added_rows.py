import numpy as np
import pytest

from lic_drake.errors import LibraryError
from lic_drake.experience.added_rows import COLUMNS, check_rows
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import load_scenario

PLANE = load_scenario("cylinder-clutter")
GOOD = {"success": "true", "goal_x": "0.6", "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0}
SPACE = {
    **{"success": True, "goal_x": 0.84, "goal_y": -0.29, "goal_z": 0.89},
    **{"start_x": 0.53, "start_y": -0.29, "start_z": 0.89, "base_y": 0.0, "torso": 0.15},
}


def test_every_column_but_where_it_happened_is_one_of_the_records_of_the_simulation() -> None:
    fields = ReachRecord.__dataclass_fields__
    for name, column in COLUMNS.items():
        assert fields[name].metadata["unit"] == column.unit, name


def test_text_and_numbers_become_columns_and_what_was_not_given_its_default() -> None:
    columns = check_rows([GOOD, {**GOOD, "success": 0, "final_x": "0.5"}], PLANE, "lab")
    assert columns["success"].tolist() == [True, False]
    assert columns["goal_x"].tolist() == [0.6, 0.6]
    assert columns["start_x"].tolist() == [PLANE.task.start_line.x_m] * 2
    assert columns["final_x"][1] == 0.5 and np.isnan(columns["final_x"][0])
    assert columns["base_y"].tolist() == [0.0, 0.0]
    assert columns.keys() == COLUMNS.keys()


def test_rows_without_environment_are_each_in_one_of_their_own() -> None:
    given = [3, None, "", 3, 7]
    rows = [{**GOOD, "environment": number} for number in given]
    environment = check_rows(rows, PLANE, "lab")["environment"]
    assert environment[[0, 3, 4]].tolist() == [3, 3, 7]
    assert len(set(environment)) == 4


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"success": "yes"}, "row 2: success is yes, which must be true or false"),
        ({"success": 0.5}, "row 2: success is 0.5"),
        ({"success": ""}, "row 2: success is empty; fill it in or leave the row out"),
        ({"goal_x": "far"}, "row 2: goal_x is far, which must be a finite number in m"),
        ({"goal_x": "nan"}, "row 2: goal_x is nan, which must be a finite number in m"),
        ({"goal_x": 1.9}, r"row 2: the goal .* the arm reaches .* choose a nearer goal, or leave"),
        ({"start_phi": 60}, "row 2: start_phi is 60 rad, .* in radians, not degrees"),
        (
            {"start_y": 0.5},
            r"row 2: start_y is 0.5 m .* from -0.42 to 0.42 m: .* leave the row out",
        ),
        ({"start_x": 0.4}, "row 2: start_x is 0.4 m from the base"),
        ({"environment": 1.5}, "row 2: environment is 1.5, which must be a whole number"),
        ({"final_x": "inf"}, "row 2: final_x is inf"),
        ({"start_qx": 0.0}, "has a column start_qx that records of cylinder-clutter do not have"),
        ({"goal": 0.0}, "a column goal .* known are success, goal_x"),
    ],
)
def test_what_cannot_be_is_refused_with_row_value_limit_and_what_to_do(
    change: dict[str, object], said: str
) -> None:
    with pytest.raises(LibraryError, match=said):
        check_rows([GOOD, {**GOOD, **change}], PLANE, "lab")


@pytest.mark.parametrize("name", GOOD)
def test_a_needed_column_that_is_missing_is_named(name: str) -> None:
    rows = [{key: value for key, value in GOOD.items() if key != name}]
    with pytest.raises(LibraryError, match=f"lab has no column '{name}' .* need success, goal_x"):
        check_rows(rows, PLANE, "lab")


def test_a_moving_base_has_to_be_given_and_carries_the_start_line() -> None:
    scenario = load_scenario("cylinder-aperture-clutter")
    with pytest.raises(LibraryError, match="no column 'base_y'"):
        check_rows([GOOD], scenario, "lab")
    shifted = {**GOOD, "goal_y": 0.6, "start_y": 0.5, "base_y": 0.5}
    assert check_rows([shifted], scenario, "lab")["base_y"].tolist() == [0.5]
    with pytest.raises(LibraryError, match=r"start_y is -0.5 m from the base"):
        check_rows([{**shifted, "start_y": 0.0}], scenario, "lab")


def test_records_in_space_need_a_quaternion_of_length_1() -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    columns = check_rows([SPACE], scenario, "lab")
    assert [columns[f"start_q{axis}"][0] for axis in "wxyz"] == [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(LibraryError, match=r"row 1: the quaternion .* divide it by its length"):
        check_rows([{**SPACE, "start_qx": 0.5}], scenario, "lab")
    with pytest.raises(LibraryError, match="no column 'torso'"):
        check_rows([{k: v for k, v in SPACE.items() if k != "torso"}], scenario, "lab")


def test_no_rows_are_refused() -> None:
    with pytest.raises(LibraryError, match="lab holds 0 records; add 1 to"):
        check_rows([], PLANE, "lab")
