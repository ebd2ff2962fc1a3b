import pytest
from service_fakes import Bench, SweepLaw, small_mission


@pytest.fixture
def mission():
    return small_mission()


@pytest.fixture
def bench(mission):
    return Bench(mission)


@pytest.fixture
def law(mission):
    return SweepLaw(mission)
