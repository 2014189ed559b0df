"""Reaches that find the environment as others before them left it."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import comparable
from support.reaches import assert_never_began, reach_request, small_clutter

from lic_drake.experience.schema import read_shard, to_records, to_table, write_table
from lic_drake.reach import session as dut
from lic_drake.reach.environment import Environment
from lic_drake.reach.record import make_record
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import ReachSession, run_reach
from lic_drake.reach.start import Start

SCENARIO = small_clutter(2.5)
FIRST = reach_request(SCENARIO, (0.7, 0.0), 0.0, 90.0, environment=2)
# The same start again; and one elsewhere, of another base.
SECOND = FIRST.then(FIRST.start)
THIRD = SECOND.then(Start(np.array([0.335, 0.1, np.deg2rad(60.0)]), np.array([0.0, 0.1, 0.0])))


pytestmark = pytest.mark.usefixtures("session")


def from_base(y_m: float, scenario: Scenario) -> ReachRequest:
    """The first reach in another scenario, the base elsewhere."""
    start = Start(FIRST.start.x0, np.array([0.0, y_m, 0.0]))
    return replace(FIRST, scenario=scenario, start=start)


def forget() -> None:
    """Makes this process as if it had simulated nothing."""
    dut.default_session(True).clear()


def alone(request: ReachRequest) -> ReachRecord:
    forget()
    return run_reach(request)


def measured(record: ReachRecord) -> str:
    """What is measured in a reach: its record without what names its request."""
    names = {item.name for item in fields(record)} - {"key", "after", "wall_time_s"}
    return repr({name: getattr(record, name) for name in sorted(names)})


def by_hand(requests: list[ReachRequest]) -> list[ReachRecord]:
    """Simulates one after the other, each in an environment built from the last one's end."""
    drawn = SCENARIO.sample_instance(FIRST.stream, FIRST.environment)
    instance, records = drawn, []
    for request in requests:
        base = request.start.b0
        environment = Environment(SCENARIO, instance, dut.default_session(True).sleep, base)
        result = environment.reach(request.goal, request.start.x0)
        assert result.trace.p_WO is not None
        instance = drawn.with_objects_at(result.trace.p_WO)
        records.append(make_record(request, result, 0.0))
    return records


def test_the_first_of_these_reaches_pushes_something() -> None:
    instance = SCENARIO.sample_instance("training", 2)
    result = dut.simulate_request(FIRST)
    moved = np.abs(result.trace.p_WO - instance.p_WO[instance.movable, :2]).max(axis=1)
    assert moved.max() > 1e-3
    assert moved.min() == 0.0
    assert result.outcome != "reached"


def test_each_reach_of_a_chain_finds_the_objects_where_the_one_before_left_them() -> None:
    chain = [FIRST, SECOND, THIRD]
    expected = by_hand(chain)
    assert comparable([alone(request) for request in chain]) == comparable(expected)


def test_a_second_reach_differs_from_one_that_finds_the_environment_as_drawn() -> None:
    assert SECOND.start == FIRST.start
    first, second = alone(FIRST), alone(SECOND)
    assert measured(first) != measured(second)
    third, fresh = alone(THIRD), alone(replace(THIRD, after=()))
    assert measured(third) != measured(fresh)


def test_a_second_reach_does_not_depend_on_what_ran_before_in_the_process() -> None:
    expected = [alone(request) for request in (SECOND, THIRD)]
    other = reach_request(SCENARIO, (0.6, 0.1), environment=0)
    forget()
    for before in ([FIRST], [FIRST, SECOND], [other, THIRD, FIRST], [THIRD], [SECOND, other]):
        for request in before:
            run_reach(request)
        assert comparable([run_reach(r) for r in (SECOND, THIRD)]) == comparable(expected)


def test_chains_are_the_same_in_another_process(sleep: bool) -> None:
    chain = [THIRD, FIRST, SECOND]
    expected = [alone(request) for request in chain]
    with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as pool:
        elsewhere = list(pool.map(partial(run_reach, sleep=sleep), chain))
    assert comparable(elsewhere) == comparable(expected)


def test_many_bases_and_histories_of_an_environment_do_not_mix(session: ReachSession) -> None:
    session.environments.size, session.ends.size = 2, 1
    shorter = small_clutter(0.4)
    chain = [replace(request, scenario=shorter) for request in (FIRST, SECOND, THIRD)]
    chain += [from_base(0.02 * k, shorter) for k in range(4)]
    expected = [ReachSession(session.sleep).run(request) for request in chain]
    again = [run_reach(request) for request in [*chain, *reversed(chain)]]
    assert comparable(again[: len(chain)]) == comparable(expected)
    assert comparable(again[len(chain) :]) == comparable(expected[::-1])
    assert len(session.environments) <= 2


@pytest.mark.parametrize("phi_deg", [-90.0, 90.0])
def test_a_reach_that_never_began_leaves_everything_in_its_place(phi_deg: float) -> None:
    goal = (0.7, 0.0) if phi_deg < 0 else (5.0, 0.0)
    nothing = reach_request(SCENARIO, goal, phi_deg=phi_deg, environment=2)
    assert_never_began(alone(nothing), "invalid_start" if phi_deg < 0 else "unreachable")
    after = nothing.then(FIRST.start)
    assert measured(alone(after)) == measured(alone(replace(after, after=())))


# Requests and records


def test_a_request_knows_the_ones_before_it() -> None:
    assert FIRST.before() is None
    assert SECOND.before() == FIRST
    assert THIRD.before() == SECOND
    assert [len(request.after) for request in (FIRST, SECOND, THIRD)] == [0, 1, 2]
    assert (THIRD.start.b0[1], THIRD.after[1]) == (0.1, SECOND.start)


@pytest.mark.parametrize("request_", [FIRST, SECOND, THIRD], ids=["first", "second", "third"])
def test_a_record_leads_back_to_its_request(request_: ReachRequest, tmp_path: Path) -> None:
    shorter = replace(request_, scenario=small_clutter(0.2))
    record = alone(shorter)
    assert len(record.after) == 5 * len(request_.after)
    assert ReachRequest.from_record(record, shorter.scenario) == shorter
    assert ReachRequest.from_record(record, shorter.scenario).key == record.key
    # Also from a file.
    path = tmp_path / "reaches.parquet"
    write_table(to_table([record], shorter.scenario), path)
    (row,) = to_records(read_shard(path)[1])
    assert ReachRequest.from_record(row, shorter.scenario) == shorter
