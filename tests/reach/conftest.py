"""Reaches are tested with and without the speed-up of `lic_drake.reach.sleeping`."""

import pytest

from lic_drake.reach.session import ReachSession


@pytest.fixture(params=[True, False], ids=["asleep", "awake"])
def sleep(request: pytest.FixtureRequest) -> bool:
    """Whether untouched objects sleep."""
    return bool(request.param)


@pytest.fixture
def session(sleep: bool) -> ReachSession:
    """A session that has simulated nothing yet."""
    return ReachSession(sleep)
