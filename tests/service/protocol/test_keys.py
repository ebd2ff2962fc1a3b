import pytest

from mpc_cover.service.protocol.keys import Keys, agent_of, matches

KEYS = Keys("box-3")


def test_the_keys_are_those_of_the_protocol():
    assert KEYS.state("a1") == "cover/box-3/agent/a1/state"
    assert KEYS.plan("a1") == "cover/box-3/agent/a1/plan"
    assert KEYS.agent_event("a1") == "cover/box-3/agent/a1/event"
    assert KEYS.agent_alive("a1", "x") == "cover/box-3/agent/a1/alive/x"
    assert (KEYS.status, KEYS.map, KEYS.controller_event, KEYS.controller_alive) == tuple(
        f"cover/box-3/ctl/{name}" for name in ("status", "map", "event", "alive")
    )
    assert KEYS.command("pause") == "cover/box-3/ctl/cmd/pause"


@pytest.mark.parametrize(
    ("key", "agent"),
    [("cover/m/agent/a1/state", "a1"), ("cover/m/ctl/status", ""), ("cover/m/ctl/cmd/pause", ""), ("", "")],
)
def test_the_agent_of_a_key(key, agent):
    assert agent_of(key) == agent


def test_a_star_stands_for_one_chunk():
    assert matches(KEYS.state(), KEYS.state("a1"))
    assert not matches(KEYS.state(), KEYS.plan("a1"))
    assert not matches("cover/*", KEYS.status)
    assert not matches(KEYS.state("a1"), KEYS.state("a2"))
