"""Flights in the simulated world: the real controller and agents, under faults."""

import pytest
from service_fakes import small_mission

from mpc_cover.mission.load import load_mission
from mpc_cover.service.torture.faults import CONTROLLER, Fault, FaultKind
from mpc_cover.service.torture.faulty_law import SOLVER_FAULTS
from mpc_cover.service.torture.world import fly

MISSION = small_mission()
"""One sweep upwards: about five seconds of flight."""


def flown(*faults, seed=1, limit_s=60.0):
    return fly(MISSION, faults, seed, limit_s=limit_s)


def said(outcome, text):
    return any(text in event for event in outcome.events)


def test_without_faults_the_mission_is_flown_and_nothing_is_violated():
    outcome = flown()
    assert outcome.finished
    assert not outcome.violations
    assert outcome.smallest_m >= MISSION.fleet.separation_min
    assert 3.0 < outcome.covered_s < 15.0


def test_a_seed_gives_the_same_trace_and_another_one_another():
    loss = Fault(FaultKind.LOSS, 0.0, 1e6, share=0.3)
    first, again, other = flown(loss), flown(loss), flown(loss, seed=2)
    assert first.digest == again.digest != other.digest
    assert first.motions == again.motions
    assert first.events == again.events


def test_messages_that_come_twice_change_nothing_that_is_flown():
    plain, twice = flown(), flown(Fault(FaultKind.DUPLICATES, 0.0, 1e6, share=0.6, delay_s=1.0))
    assert twice.motions == plain.motions


def test_steps_of_the_wall_clock_change_nothing_that_is_flown():
    steps = [Fault(FaultKind.CLOCKS, 3.0, targets=(name,), delay_s=3600.0) for name in ("a1", "a2", CONTROLLER)]
    assert flown(*steps).motions == flown().motions


def test_an_agent_that_dies_is_missed_and_its_body_brakes_and_stays():
    outcome = flown(Fault(FaultKind.DEATHS, 4.0, targets=("a2",)))
    assert outcome.died == ("a2",)
    assert said(outcome, "a2 is lost")
    *_, last = outcome.motions["a2"]
    assert last.velocity == pytest.approx([0.0, 0.0], abs=1e-9)
    assert "jump" not in {violation.what for violation in outcome.violations}


def test_a_restarted_agent_goes_on_where_it_stands_and_is_back():
    outcome = flown(Fault(FaultKind.RESTARTS, 4.0, 2.0, ("a2",)))
    assert outcome.finished
    assert said(outcome, "a2 is back")
    assert not outcome.violations


@pytest.mark.parametrize("way", ["at once", "publishing"])
def test_a_restarted_controller_goes_on_from_its_checkpoint_with_another_epoch(way):
    outcome = flown(Fault(FaultKind.RESTARTS, 4.0, 2.0, (CONTROLLER,), 0.1, way=way))
    assert outcome.finished
    assert said(outcome, "controller of epoch 2 starts goes on from the checkpoint")
    assert not outcome.violations


def test_a_controller_that_dies_for_good_leaves_everyone_at_rest():
    outcome = flown(Fault(FaultKind.DEATHS, 4.0, targets=(CONTROLLER,)))
    assert not outcome.finished
    assert not outcome.violations
    assert all(pieces[-1].velocity == pytest.approx([0.0, 0.0], abs=1e-6) for pieces in outcome.motions.values())


def test_on_a_full_disk_control_goes_on_and_a_controller_cannot_start():
    outcome = flown(
        Fault(FaultKind.DISK, 3.0, 4.0, (CONTROLLER,), way="full"),
        Fault(FaultKind.RESTARTS, 4.5, 1.0, (CONTROLLER,)),
    )
    assert outcome.finished
    assert said(outcome, "the checkpoint cannot be written")
    assert said(outcome, "controller cannot start: ")
    assert not outcome.violations


def test_an_agent_that_is_frozen_reports_one_place_and_flies_on():
    outcome = flown(Fault(FaultKind.FROZEN, 3.0, 3.0, ("a1",)))
    positions = {tuple(piece.position) for piece in outcome.motions["a1"] if 3.5 < piece.time_s < 4.0}
    assert len(positions) > 1


def test_a_twin_is_turned_away_and_its_body_is_nobodys():
    outcome = flown(Fault(FaultKind.TWINS, 3.0, 4.0, ("a1",)))
    assert outcome.finished
    assert said(outcome, "says that it is a1, too")
    assert not outcome.violations


@pytest.mark.parametrize("way", SOLVER_FAULTS)
def test_whatever_a_solver_does_nothing_unsafe_is_flown(way):
    outcome = flown(Fault(FaultKind.SOLVER, 2.5, 2.0, way=way, delay_s=1.5))
    assert outcome.finished
    assert not outcome.violations


@pytest.mark.parametrize("whom", ["a1", CONTROLLER])
def test_a_process_that_is_stopped_goes_on(whom):
    outcome = flown(Fault(FaultKind.STOPS, 3.0, 2.5, (whom,), held=True))
    assert outcome.finished
    assert not outcome.violations


def test_a_controller_that_was_taken_over_finds_that_out_and_nobody_flies_its_plans():
    fault = Fault(FaultKind.TAKEOVERS, 4.0, 3.0, (CONTROLLER,), held=True)
    outcome = fly(small_mission(12.0), [fault], 1, limit_s=60.0)
    assert outcome.finished
    assert said(outcome, "controller of epoch 2 starts")
    assert said(outcome, "a controller of epoch 2 has taken over")
    assert not outcome.violations


@pytest.mark.parametrize(
    ("fault", "seed"),
    [
        (Fault(FaultKind.STOPS, 2.51, 4.90, ("a1",)), 0),
        (Fault(FaultKind.FROZEN, 1.42, 4.60, ("a3",)), 15),
    ],
)
def test_nobody_comes_too_near_to_who_flies_what_it_may_hold(fault, seed):
    """Each collided once: a plan was made for agents that flew earlier plans than was thought."""
    outcome = fly(load_mission("crowded-3"), [fault], seed, limit_s=60.0)
    assert "separation" not in {violation.what for violation in outcome.violations}
    assert outcome.smallest_m >= 0.5
