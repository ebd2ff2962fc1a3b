"""A user's constraints as lines of a report: one each, or what holds in one where there are many."""

import pytest
from tiny_mission import TINY

import mpc_cover
from mpc_cover.information.replay import measured_at
from mpc_cover.model.trajectory import Trajectory

MISSION = mpc_cover.load_mission(TINY)


@pytest.fixture(scope="module")
def resting():
    """A recording of a fleet that stays where it is."""
    motion = Trajectory.at_rest(MISSION.fleet.start, 0.0, 0.5, 20)
    return mpc_cover.Recording(
        motion.time,
        motion.position,
        motion.velocity,
        motion.input,
        cell=MISSION.field.cell,
        covered_at=measured_at(MISSION, motion.time, motion.position),
        agent_id=MISSION.fleet.ids,
        mission=MISSION,
    )


def lines_of(recording, extra):
    before = len(mpc_cover.check(recording).checks)
    return mpc_cover.check(recording, extra=extra).checks[before:]


def test_each_constraint_has_a_line_with_its_name(resting):
    def walls(motion, mission):
        return [], {"east": motion.position[:, :, 0] <= 2.5, "west": motion.position[:, :, 0] >= 1.0}

    east, west = lines_of(resting, walls)
    assert (east.name, east.holds, east.margin) == ("walls east", True, pytest.approx(0.25))
    assert (west.name, west.holds, west.margin) == ("walls west", False, pytest.approx(-0.25))
    assert not mpc_cover.check(resting, extra=walls).holds


def test_of_many_only_those_that_fail_have_lines_of_their_own(resting):
    def rows(motion, mission):
        return [], [q[:, 0] <= (1.0 if n == 3 else 2.5) for n, q in enumerate(motion.position)]

    failed, shared = lines_of(resting, rows)
    assert (failed.name, failed.margin) == ("rows constraints[3]", pytest.approx(-1.25))
    assert (shared.name, shared.where, shared.margin) == ("rows", "20 constraints", pytest.approx(0.25))


def test_what_fails_to_be_a_constraint_is_a_mistake_not_a_line(resting):
    with pytest.raises(mpc_cover.UserError, match=r"constraints\[0\]: .* not convex"):
        mpc_cover.check(resting, extra=lambda motion, _: ([], [motion.position[0, 0, 0] ** 2 >= 1.0]))
