"""What a demo says when all went well."""

from threading import Event
from types import SimpleNamespace

import pytest

from mpc_cover.mission.load import load_mission
from mpc_cover.service.run.demo_watch import Watch, completion_text


@pytest.mark.parametrize(("name", "words"), [("patrol", "the patrol is over"), ("kalman", "everything is covered")])
def test_a_patrol_is_never_said_to_have_everything_covered(name, words):
    processes = SimpleNamespace(
        controller=SimpleNamespace(name="controller", pid=1, exit_status=0),
        agents=[SimpleNamespace(name="a1", pid=2, exit_status=None)],
        dead_agents=list,
        start=lambda: None,
    )
    observer, progress = SimpleNamespace(status=None, look=list), SimpleNamespace(say=lambda _: None)
    signals = SimpleNamespace(stop=Event())
    watch = Watch(processes, observer, signals, progress, over=completion_text(load_mission(name)))
    assert watch.until_over().text == words
