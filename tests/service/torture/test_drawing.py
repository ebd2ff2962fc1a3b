"""What is drawn from seeds."""

import pytest
from service_fakes import small_mission

from mpc_cover.service.torture.drawing import draw
from mpc_cover.service.torture.faults import CONTROLLER, FaultKind

MISSION = small_mission()


@pytest.mark.parametrize("kind", FaultKind)
def test_a_kind_asked_for_alone_is_drawn_alone_for_processes_that_there_are(kind):
    for seed in range(40):
        found, faults = draw(MISSION, [kind], seed)
        assert found is kind
        assert faults
        also = {FaultKind.RESTARTS} if kind is FaultKind.DISK else set()
        assert {fault.kind for fault in faults} <= {kind} | also
        assert all(set(fault.targets) <= {"a1", "a2", CONTROLLER} for fault in faults)
        assert all(fault.start_s >= 0.0 and fault.duration_s >= 0.0 and 0.0 <= fault.share <= 1.0 for fault in faults)
        assert [fault.start_s for fault in faults] == sorted(fault.start_s for fault in faults)
        assert draw(MISSION, [kind], seed) == (found, faults)


def test_seeds_differ_and_several_kinds_are_also_mixed():
    drawn = [draw(MISSION, list(FaultKind), seed) for seed in range(200)]
    assert len({faults for _, faults in drawn}) == 200
    found = [kind for kind, _ in drawn]
    assert set(found) == {*FaultKind, None}
    assert 0.2 < found.count(None) / len(found) < 0.5


def test_somebody_is_left_of_those_who_die():
    for seed in range(100):
        _, faults = draw(MISSION, [FaultKind.DEATHS], seed)
        assert len({fault.targets for fault in faults} - {(CONTROLLER,)}) < MISSION.fleet.size
