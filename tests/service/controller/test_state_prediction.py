"""Plans are made for where the agents will be, to the last digits."""

from collections import Counter

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import StraightSweepLaw

WINDY = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.03, "wind_m_per_s2": [0.0, 0.05]}


@pytest.mark.parametrize("disturbance", [{}, WINDY], ids=["undisturbed", "from the reference, not from a measurement"])
def test_what_is_predicted_is_where_plans_have_them(disturbance):
    bench = Bench(small_mission(disturbance=disturbance))
    fleet, law = [bench.agent("a1"), bench.agent("a2")], StraightSweepLaw(bench.mission)
    controller = bench.controller(law)
    truth = {}

    def note(_):
        for index, agent in enumerate(fleet):
            truth.setdefault(round(agent.plant.time_s, 6), {})[index] = agent.plant.position.copy()

    bench.run(controller, until=lambda: controller.done, after=note)
    assert controller.exit_status == 0
    origin = 100.0 + 0.5  # first tick plans, take-off a period later
    seen = 0
    for state in law.in_flight:
        there = truth.get(round(origin + state.time, 6), {})
        if len(there) == 2:
            np.testing.assert_allclose(state.position, [there[0], there[1]], atol=1e-9)
            seen += 1
    assert seen > 5
    assert not Counter(agent.rejected for agent in fleet if agent.rejected)
