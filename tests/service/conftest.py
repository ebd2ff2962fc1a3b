import pytest
from service_fakes import Bench, SweepBrain, small_mission


@pytest.fixture
def mission():
    return small_mission()


@pytest.fixture
def bench(mission):
    return Bench(mission)


@pytest.fixture
def brain(mission):
    return SweepBrain(mission)
