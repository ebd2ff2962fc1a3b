"""What a demo says when all went well."""

from types import SimpleNamespace

import pytest

from mpc_cover.mission.load import load_mission
from mpc_cover.service.run.demo_watch import Watch, completion_text


@pytest.mark.parametrize(("name", "words"), [("patrol", "the patrol is over"), ("kalman", "everything is covered")])
def test_a_patrol_is_never_said_to_have_everything_covered(name, words):
    processes = SimpleNamespace(controller=SimpleNamespace(exit_status=0), agents=[], dead_agents=list)
    watch = Watch(processes, SimpleNamespace(status=None), None, None, over=completion_text(load_mission(name)))
    processes.agents.append(SimpleNamespace(name="a1"))
    assert watch._outcome().text == words
