import pytest
from service_fakes import Bench, small_mission
from sweep_laws import StraightSweepLaw


@pytest.fixture
def mission():
    return small_mission()


@pytest.fixture
def bench(mission):
    return Bench(mission)


@pytest.fixture
def law(mission):
    return StraightSweepLaw(mission)


@pytest.fixture
def fleet(bench):
    return [bench.agent("a1"), bench.agent("a2")]
