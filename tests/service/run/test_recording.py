"""The trajectory is what the agents flew, to the last digits."""

import numpy as np
import pytest
from service_fakes import straight_plan

from mpc_cover.errors import UnreadableFileError
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.run.recording import merge
from mpc_cover.verification.check import check_trajectory


@pytest.fixture
def flown(bench):
    """Return the records of two agents of which the second starts 0.13 s later."""
    agents = [bench.agent("a1"), bench.agent("a2")]
    bench.run(seconds=0.25)
    for agent, start_s in zip(agents, (100.5, 100.63), strict=True):
        publisher = bench.bus.join().publisher(bench.keys.plan(agent.id), bus.PLAN)
        publisher.publish(encode(straight_plan(agent, start_s)))
    bench.run(seconds=10.0)
    for agent in agents:
        agent.shutdown()
    return [bench.records[name].pieces for name in ("a1", "a2")]


def test_it_starts_with_the_first_plan_and_ends_at_rest(mission, flown):
    trajectory = merge(mission, flown, {"kind": "demo"})
    assert trajectory.time[0] == 0.0
    assert not trajectory.velocity[0].any()
    assert trajectory.time[-1] == pytest.approx(2.13)
    assert np.abs(trajectory.velocity[-1]).max() < 1e-9
    assert 0.13 in np.round(trajectory.time, 6)
    assert check_trajectory(trajectory).holds


def test_the_motion_follows_from_its_inputs_exactly(mission, flown):
    trajectory = merge(mission, flown, {})
    dt = np.diff(trajectory.time)[:, None, None]
    velocity = trajectory.velocity[:-1] + dt * trajectory.input
    position = trajectory.position[:-1] + dt * trajectory.velocity[:-1] + 0.5 * dt**2 * trajectory.input
    np.testing.assert_allclose(velocity, trajectory.velocity[1:], atol=1e-9)
    np.testing.assert_allclose(position, trajectory.position[1:], atol=1e-9)
    np.testing.assert_array_equal(np.unique(np.round(trajectory.input, 12)), [-0.4, 0.0, 0.8])


def test_a_record_that_ends_early_ends_the_trajectory(mission, flown):
    cut = next(index for index, piece in enumerate(flown[1]) if piece.time_s > 101.0)
    trajectory = merge(mission, [flown[0], flown[1][:cut]], {})
    assert trajectory.time[-1] == pytest.approx(flown[1][cut - 1].time_s - 100.5)
    assert trajectory.velocity[-1].any()


@pytest.mark.parametrize("known", ["a report", "a torn line"])
def test_whoever_died_is_braked_from_its_last_state_and_the_rest_is_flown(mission, flown, known):
    cut = next(index for index, piece in enumerate(flown[1]) if piece.time_s > 101.0)
    dead = flown[1][: cut + (1 if known == "a report" else 0)]
    trajectory = merge(mission, [flown[0], dead], {}, died=["a2"])
    assert trajectory.meta["lost"] == {"a2": pytest.approx(dead[-1].time_s - 100.5)}
    assert trajectory.time[-1] > 1.9
    assert check_trajectory(trajectory).holds
    speed = np.linalg.norm(dead[-1].velocity)
    stopped = np.add(dead[-1].position, [0.0, 0.5 * speed**2])
    np.testing.assert_allclose(trajectory.position[-1, 1], stopped, atol=1e-6)
    assert np.abs(trajectory.input).max() == pytest.approx(1.0)


def test_when_all_died_the_record_ends_with_the_last_of_them(mission, flown):
    cuts = [
        next(index for index, piece in enumerate(pieces) if piece.time_s > time_s)
        for pieces, time_s in zip(flown, (100.9, 101.2), strict=True)
    ]
    dead = [pieces[:cut] for pieces, cut in zip(flown, cuts, strict=True)]
    trajectory = merge(mission, dead, {}, died=["a1", "a2"])
    assert trajectory.time[-1] == pytest.approx(dead[1][-1].time_s - 100.5)
    assert check_trajectory(trajectory).holds


def test_nobody_flew(mission, bench):
    agents = [bench.agent("a1"), bench.agent("a2")]
    bench.run(seconds=1.0)
    for agent in agents:
        agent.shutdown()
    trajectory = merge(mission, [bench.records[name].pieces for name in ("a1", "a2")], {})
    assert trajectory.time[0] == 0.0
    assert not trajectory.velocity.any()
    assert check_trajectory(trajectory).holds


def test_a_flight_that_ended_as_it_began_is_a_record_of_rest(mission, bench):
    agents = [bench.agent("a1"), bench.agent("a2")]
    bench.run(seconds=0.05)
    for agent in agents:
        agent.shutdown()
    records = [bench.records[name].pieces[:1] * 2 for name in ("a1", "a2")]
    trajectory = merge(mission, records, {})
    assert trajectory.time == pytest.approx([0.0, mission.spec.control.state_period_s])
    assert not trajectory.velocity.any()
    assert check_trajectory(trajectory).holds


def test_no_record_is_told(mission, flown):
    with pytest.raises(UnreadableFileError, match="no motion was recorded of a2"):
        merge(mission, [flown[0], []], {})


def test_records_without_a_common_time_are_told(mission, flown):
    early, late = flown[0][:5], flown[1][-5:]
    with pytest.raises(UnreadableFileError, match="no time in common"):
        merge(mission, [early, late], {})
