"""Agents without a controller: what is not heard costs time only, and nobody knows more than is true."""

import msgspec
import numpy as np
from swarm_missions import swarm_mission

from mpc_cover.service.run.swarm_simulate import fly_swarm
from mpc_cover.verification.check import check_trajectory


def test_words_that_get_lost_cost_time_only():
    rng = np.random.default_rng(0)

    def channel(key, payload):
        return [] if key.endswith("/word") and rng.random() < 0.15 else [payload, payload]

    flight = fly_swarm(swarm_mission(4), seed=3, channel=channel)
    assert flight.complete, "what is missed is asked for again"
    assert check_trajectory(flight.trajectory).holds


def test_maps_over_estimate_until_word_comes():
    mission = swarm_mission(4, size=6.0)
    owed = {}

    def channel(key, payload):
        if key.endswith("/word"):
            word = msgspec.json.decode(payload)
            owed.setdefault(word["own"]["sample"], {})[word["agent"]] = word.get("owed", 0)
        return [payload]

    flight = fly_swarm(mission, seed=1, channel=channel)
    for sample, each in owed.items():
        true = (flight.trajectory.covered_at > (sample - 1) * 0.5 + 1e-9).sum()
        assert min(each.values()) >= true
