"""Reaches that find the environment as others before them left it."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import comparable
from support.reaches import assert_never_began, reach_request, small_clutter

from lic_drake.experience.schema import read_shard, to_records, to_table, write_table
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import ReachSession, make_record, run_reach
from lic_drake.reach.start import Start

SCENARIO = small_clutter(2.0)
FIRST = reach_request(SCENARIO, (0.7, 0.0), 0.0, 90.0, environment=2)
# The same start again; and one elsewhere, of another base.
SECOND = FIRST.then(FIRST.start)
THIRD = SECOND.then(Start(np.array([0.335, 0.1, np.deg2rad(60.0)]), np.array([0.0, 0.1, 0.0])))
CHAIN = (FIRST, SECOND, THIRD)


def from_base(y_m: float, scenario: Scenario) -> ReachRequest:
    """The first reach in another scenario, the base elsewhere."""
    start = Start(FIRST.start.x0, np.array([0.0, y_m, 0.0]))
    return replace(FIRST, scenario=scenario, start=start)


@cache
def alone(request: ReachRequest, sleep: bool = True) -> ReachRecord:
    """The record of a process that has simulated nothing else."""
    return ReachSession(sleep).run(request)


def measured(record: ReachRecord) -> str:
    """What is measured in a reach: its record without what names its request."""
    names = {item.name for item in fields(record)} - {"key", "after", "wall_time_s"}
    return repr({name: getattr(record, name) for name in sorted(names)})


def test_each_reach_of_a_chain_finds_the_objects_where_the_one_before_left_them(
    sleep: bool,
) -> None:
    # By hand: each in an environment built from the last one's end.
    drawn = SCENARIO.sample_instance(FIRST.stream, FIRST.environment)
    instance, expected = drawn, []
    for request in CHAIN:
        environment = Environment(SCENARIO, instance, sleep, request.start.b0)
        result = environment.reach(request.goal, request.start.x0)
        assert result.trace.q_clutter is not None
        instance = drawn.with_objects_at(result.trace.q_clutter)
        expected.append(make_record(request, result, 0.0))
    moved = np.linalg.norm(instance.p_WO - drawn.p_WO, axis=1)[drawn.movable]
    assert moved.max() > 1e-3 and moved.min() == 0.0
    assert comparable([alone(request, sleep) for request in CHAIN]) == comparable(expected)
    for later in (SECOND, THIRD):
        assert measured(alone(later, sleep)) != measured(alone(replace(later, after=()), sleep))


def test_a_second_reach_does_not_depend_on_what_ran_before_in_the_process(sleep: bool) -> None:
    expected = [alone(request, sleep) for request in (SECOND, THIRD)]
    other = reach_request(SCENARIO, (0.6, 0.1), environment=0)
    for before in ([FIRST], [other, THIRD, FIRST]):
        session = ReachSession(sleep)
        for request in before:
            session.run(request)
        assert comparable([session.run(r) for r in (SECOND, THIRD)]) == comparable(expected)


def test_chains_are_the_same_in_another_process(sleep: bool) -> None:
    expected = [alone(request, sleep) for request in CHAIN]
    with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as pool:
        elsewhere = list(pool.map(partial(run_reach, sleep=sleep), CHAIN[::-1]))
    assert comparable(elsewhere[::-1]) == comparable(expected)


def test_many_bases_and_histories_of_an_environment_do_not_mix(session: ReachSession) -> None:
    session.environments.size, session.ends.size = 2, 1
    shorter = small_clutter(0.2)
    chain = [replace(request, scenario=shorter) for request in CHAIN[1:]]
    chain.append(from_base(0.02, shorter))
    expected = [ReachSession(session.sleep).run(request) for request in chain]
    again = [session.run(request) for request in [*chain, *reversed(chain)]]
    assert comparable(again[: len(chain)]) == comparable(expected)
    assert comparable(again[len(chain) :]) == comparable(expected[::-1])
    assert len(session.environments) <= 2


@pytest.mark.parametrize("phi_deg", [-90.0, 90.0])
def test_a_reach_that_never_began_leaves_everything_in_its_place(phi_deg: float) -> None:
    goal = (0.7, 0.0) if phi_deg < 0 else (5.0, 0.0)
    nothing = reach_request(small_clutter(0.5), goal, phi_deg=phi_deg, environment=2)
    assert_never_began(alone(nothing), "invalid_start" if phi_deg < 0 else "unreachable")
    after = nothing.then(FIRST.start)
    assert measured(alone(after)) == measured(alone(replace(after, after=())))


# Requests and records


def test_a_request_knows_the_ones_before_it() -> None:
    assert [request.before() for request in CHAIN] == [None, FIRST, SECOND]
    assert [len(request.after) for request in CHAIN] == [0, 1, 2]
    assert (THIRD.start.b0[1], THIRD.after[1]) == (0.1, SECOND.start)


def test_a_record_leads_back_to_its_request_also_from_a_file(tmp_path: Path) -> None:
    requests = [replace(request, scenario=small_clutter(0.2)) for request in CHAIN]
    records = [alone(request) for request in requests]
    assert [len(record.after) for record in records] == [0, 5, 10]
    path = tmp_path / "reaches.parquet"
    write_table(to_table(records, requests[0].scenario), path)
    for rows in (records, to_records(read_shard(path)[1])):
        found = [ReachRequest.from_record(row, requests[0].scenario) for row in rows]
        assert found == requests
        assert [request.key for request in found] == [record.key for record in records]
