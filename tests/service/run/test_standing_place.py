"""Where a vehicle stands whose agent is started anew, as far as a controller says so."""

from threading import Event

import numpy as np
import pytest
from service_fakes import Bench

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.messages import Phase, Status, encode
from mpc_cover.service.run import standing_place as module
from mpc_cover.service.run.standing_place import standing_place


@pytest.fixture
def say(bench, monkeypatch):
    """Return a function that makes a controller say where agents stand."""
    monkeypatch.setattr(module, "ASK_S", 0.1)

    def say(standing, instances=("a1", "a2")):
        transport = bench.bus.join()
        transport.announce(bench.keys.controller_instance("c"))
        status = Status(
            controller="c",
            epoch=1,
            seq=0,
            phase=Phase.FLYING,
            mission_time_s=1.0,
            covered_count=0,
            cell_count=1,
            instances=dict.fromkeys(instances, "life"),
            standing=standing,
        )
        transport.publisher(bench.keys.status, bus.STATUS).publish(encode(status))

    return say


def asked(bench: Bench, name="a1"):
    return standing_place(bench.mission, name, bench.bus.join(), Event())


def test_it_stands_where_the_controller_knows_it(bench, say):
    say({"a1": [1.25, 2.0]})
    np.testing.assert_array_equal(asked(bench), [1.25, 2.0])


def test_without_a_controller_it_stands_at_the_start(bench, mission):
    assert asked(bench) is None


def test_so_it_does_when_nobody_has_heard_it_before(bench, say):
    say({"a2": [1.25, 2.0]}, instances=["a2"])
    assert asked(bench) is None


def test_one_that_still_brakes_is_waited_for_but_not_for_ever(bench, say):
    say({}, instances=["a1"])
    assert asked(bench) is None


@pytest.mark.parametrize("place", [[1.0], [1.0, 2.0, 3.0], [-9.0, 2.0], [1.0, 1e9]])
def test_no_vehicle_stands_where_none_can_be(bench, say, place):
    say({"a1": place})
    assert asked(bench) is None
