import pytest
from watched_demo import Demo


@pytest.fixture
def start(tmp_path):
    started = []

    def start(mission, *options):
        started.append(Demo(tmp_path, mission, *options))
        return started[-1]

    yield start
    for demo in started:
        demo.stop()
