import pytest
from support.success_worlds import Library, World, scattered_library


@pytest.fixture(scope="session")
def world() -> World:
    return World()


@pytest.fixture
def scattered() -> Library:
    return scattered_library()
