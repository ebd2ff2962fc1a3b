"""A controller that is given another version of its mission in flight: agents stay, the map goes on, plans are new."""

import json

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import SharingLaw, StraightSweepLaw

from mpc_cover.mission.load import mission_from_json
from mpc_cover.service.controller.checkpoint import FileCheckpoints
from mpc_cover.service.controller.state_directory import StateDirectory
from mpc_cover.service.protocol.decoding import decode_reply, decode_status
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode


def version(mission, low=0.0, high=4.0, **control):
    """Return a mission with the area between two heights [m], all in the same box; `control` as in a mission file."""
    raw = json.loads(mission.to_json())
    raw["area"]["shape"] = {"kind": "box", "min_m": [0.0, low], "max_m": [3.0, high]}
    raw["area"] |= {"motion_min_m": [0.0, 0.0], "motion_max_m": [3.0, 9.0]}
    raw["control"] |= control
    return mission_from_json(json.dumps(raw), "version")


@pytest.fixture
def mission():
    return version(small_mission())


@pytest.fixture
def start(bench):
    """Return a function that starts a controller that can be retasked."""
    return lambda law=None, **options: bench.controller(
        law or StraightSweepLaw(bench.mission), law_for=climbing, **options
    )


def climbing(mission):
    """Return a law that sweeps up to the upper edge of a mission's area, and down again."""
    return StraightSweepLaw(mission, goal_y=float(mission.field.shape_max[1]) - 0.5)


def ask(bench, mission, request="r1"):
    """Ask for a retask; the list that is returned holds the answer after a tick."""
    text = mission if isinstance(mission, str) else mission.to_json()
    return bench.bus.join().post(bench.keys.command("retask"), encode(CommandRequest(request=request, mission=text)))


def reply(answers):
    ((answered, payload),) = answers
    assert answered
    return decode_reply(payload)


def flying(controller):
    return lambda: controller.phase is Phase.FLYING


def test_in_flight_everyone_comes_to_rest_and_flies_on_for_the_new_area(bench, fleet, start):
    controller = start()
    bench.run(controller, until=lambda: controller.mission_time_s > 2.0)
    before = controller.coverage
    other = version(bench.mission, 1.0, 6.0, time_limit_s=90.0)
    answers = ask(bench, other)
    bench.run(controller, until=lambda: answers)
    said = reply(answers)
    assert said.accepted
    assert said.phase is Phase.WAITING
    assert controller.mission.to_json() == other.to_json()
    known = controller.coverage.covered_count
    assert said.text.startswith(f"retask: {known} of {other.field.size} cells are covered already")
    common = bench.mission.field.cell[:, 1] > 1.0
    assert known == before.settled[common].sum() > 0
    at_rest = []
    bench.run(controller, until=flying(controller), after=lambda _: at_rest.append(all(a.at_rest for a in fleet)))
    assert controller.law.states[0].settled
    assert any(at_rest)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert controller.coverage.complete
    assert not any(agent.rejected for agent in fleet)
    assert not controller.fleet_monitor.rejected


def test_what_is_measured_while_everyone_comes_to_rest_counts_for_the_new_area(bench, fleet, start):
    controller = start()
    bench.run(controller, until=lambda: controller.mission_time_s > 2.0)
    other = version(bench.mission, 2.0, 4.0)
    answers = ask(bench, other)
    bench.run(controller, until=lambda: answers)
    known = controller.coverage.covered_count
    bench.run(controller, until=flying(controller))
    assert controller.coverage.covered_count > known


def test_agents_that_know_what_the_mission_was_are_accepted_and_named(bench, fleet, start):
    controller = start()
    bench.run(controller, until=flying(controller))
    ask(bench, version(bench.mission, 0.0, 5.0))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    told = [event.text for event in bench.events() if event.kind == "versions"]
    assert told == ["started with an earlier version of this mission, for the same fleet: a1, a2"]


def test_agents_may_be_started_with_either_version_and_no_other(bench, start):
    controller, other = start(), version(bench.mission, 0.0, 5.0)
    answers = ask(bench, other)
    bench.run(controller, until=lambda: answers)
    assert reply(answers).accepted
    bench.agent("a1")
    bench.mission = version(bench.mission, 0.0, 8.0)
    stranger = bench.agent("a2")
    bench.run(controller, seconds=2.0)
    assert controller.heartbeat.text == "a2 has another version of this mission"
    bench.kill(stranger)
    bench.mission = other
    bench.agent("a2")
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_back_to_what_it_was(bench, fleet, start):
    controller, first, other = start(), bench.mission, version(bench.mission, 0.0, 5.0)
    for number, wanted in enumerate((other, first)):
        bench.run(controller, until=flying(controller))
        ask(bench, wanted, f"r{number}")
        bench.run(controller, until=lambda wanted=wanted: controller.mission.to_json() == wanted.to_json())
    assert not controller.fleet_monitor.on_earlier_versions()
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_after_everything_is_covered_one_that_stays_goes_on(bench, fleet, start):
    controller = start(stay=True)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    ended_s = controller.mission_time_s
    bench.run(controller, seconds=1000.0)
    ask(bench, version(bench.mission, 2.0, 7.0))
    bench.run(controller, until=flying(controller))
    assert controller.mission_time_s == pytest.approx(ended_s, abs=1.0)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    assert not controller.done
    assert controller.coverage.complete
    assert np.nanmin(controller.coverage.first) < ended_s < np.nanmax(controller.coverage.first)


def test_a_patrol_that_is_over_has_no_mission_time_left_to_lose(bench):
    raw = json.loads(version(bench.mission, time_limit_s=5.0).to_json())
    raw["information"] = {"kind": "ageing", "age_limit_s": 4.0}
    mission = bench.mission = mission_from_json(json.dumps(raw), "patrol")
    for name in mission.fleet.ids:
        bench.agent(name)
    controller = bench.controller(climbing(mission), law_for=climbing, stay=True)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    bench.run(controller, seconds=500.0)
    answers = ask(bench, version(mission, 0.0, 6.0, time_limit_s=40.0))
    bench.run(controller, until=flying(controller))
    assert reply(answers).accepted
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    assert controller.mission_time_s == pytest.approx(40.0, abs=1.0)
    assert np.isfinite(controller.coverage.covered_at).all()


def test_what_is_known_already_is_not_flown_again(bench, fleet, start):
    controller = start(stay=True)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    steps = len(controller.step_log.steps)
    answers = ask(bench, version(bench.mission, 1.0, 3.0))
    bench.run(controller, until=lambda: answers)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    assert len(controller.step_log.steps) == steps


def test_a_paused_fleet_waits_for_resume(bench, fleet, start):
    controller = start()
    bench.run(controller, until=lambda: controller.mission_time_s > 1.0)
    asker = bench.bus.join()
    asker.post(bench.keys.command("pause"), encode(CommandRequest(request="p")))
    bench.run(controller, seconds=10.0)
    answers = ask(bench, version(bench.mission, 0.0, 5.0))
    bench.run(controller, seconds=5.0)
    assert reply(answers).accepted
    assert controller.heartbeat.text == "paused"
    asker.post(bench.keys.command("resume"), encode(CommandRequest(request="r")))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert controller.coverage.cell_count == 60


def test_a_refusal_says_everything_at_once_and_changes_nothing(bench, fleet, start):
    controller = start()
    bench.run(controller, until=flying(controller))
    mission, law = controller.mission, controller.law
    raw = json.loads(version(bench.mission).to_json())
    raw["area"]["motion_max_m"] = [3.0, 20.0]
    raw["fleet"]["separation_min_m"] = 0.4
    answers = ask(bench, json.dumps(raw))
    junk = ask(bench, "{", "r2")
    bench.run(controller, until=lambda: answers and junk)
    said = reply(answers)
    assert (said.accepted, said.phase) == (False, Phase.FLYING)
    assert [problem.split(":")[0] for problem in said.problems] == ["area.motion_max_m", "fleet.separation_min_m"]
    assert "holds no readable mission" in reply(junk).text
    assert controller.phase is Phase.FLYING
    assert (controller.mission, controller.law) == (mission, law)


def test_a_repeated_request_gets_the_same_reply_and_is_obeyed_once(bench, fleet, start):
    controller, other = start(), version(bench.mission, 0.0, 5.0)
    bench.run(controller, until=flying(controller))
    first, second = ask(bench, other), ask(bench, other)
    bench.run(controller, until=flying(controller))
    bench.run(controller, until=lambda: len(controller.law.states) > 2)
    law, third = controller.law, ask(bench, other)
    bench.run(controller, until=lambda: third)
    assert reply(first).text == reply(second).text == reply(third).text
    assert controller.law is law
    assert controller.phase is Phase.FLYING


def sharing(mission):
    return SharingLaw(mission, goal_y=float(mission.field.shape_max[1]) - 0.5)


def test_who_was_lost_is_known_to_the_new_law(bench, fleet):
    controller = bench.controller(sharing(bench.mission), law_for=sharing)
    bench.run(controller, until=lambda: len(controller.law.states) > 2)
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: controller.supervisor.lost == ["a2"])
    answers = ask(bench, version(bench.mission, 0.0, 5.0))
    bench.run(controller, until=lambda: answers)
    bench.run(controller, until=flying(controller))
    assert controller.law.lost[0] == [False, True]
    assert controller.supervisor.lost == ["a2"]


def test_who_is_slow_is_known_to_the_new_law():
    mission = version(small_mission(height=9.0, disturbance={"slow_agents": {"a2": 0.5}}), 0.0, 9.0)
    bench = Bench(mission)
    for name in mission.fleet.ids:
        bench.agent(name)
    controller = bench.controller(first := sharing(mission), law_for=sharing)
    bench.run(controller, until=lambda: first.slowed)
    answers = ask(bench, version(mission, 1.0, 9.0, time_limit_s=90.0))
    bench.run(controller, until=lambda: answers and controller.law.slowed)
    assert controller.law.slowed[0] == first.slowed[-1]


@pytest.mark.parametrize("how", ["abort", "no law"])
def test_one_that_cannot_go_on_refuses(bench, fleet, start, how):
    controller = bench.controller(StraightSweepLaw(bench.mission)) if how == "no law" else start()
    bench.run(controller, until=flying(controller))
    if how == "abort":
        bench.bus.join().post(bench.keys.command("abort"), encode(CommandRequest(request="a")))
    answers = ask(bench, version(bench.mission, 0.0, 5.0))
    bench.run(controller, until=lambda: answers)
    assert not reply(answers).accepted


def test_the_status_counts_the_new_cells(bench, fleet, start):
    controller = start()
    inbox = bench.hear(bench.keys.status)
    bench.run(controller, until=flying(controller))
    ask(bench, version(bench.mission, 0.0, 5.0))
    bench.run(controller, until=lambda: controller.done)
    assert [decode_status(item.payload).cell_count for item in inbox.drain()][-1] == 60


def test_a_successor_goes_on_with_the_new_version_and_the_agents_that_know_the_old_one(bench, fleet, start, tmp_path):
    other = version(bench.mission, 1.0, 7.0)
    with StateDirectory(tmp_path) as folder:
        controller = start(checkpoints=FileCheckpoints(folder, bench.mission))
        bench.run(controller, until=lambda: controller.mission_time_s > 2.0)
        answers = ask(bench, other)
        bench.run(controller, until=lambda: answers)
        bench.run(controller, until=flying(controller))
        first = controller.coverage.first
    bench.run(seconds=20.0)  # it is dead: nobody ticks it
    with StateDirectory(tmp_path) as folder:
        assert "is of another version of this mission" in FileCheckpoints(folder, bench.mission).load()[1]
        checkpoints = FileCheckpoints(folder, other)
        resume, text = checkpoints.load()
        assert "goes on from the checkpoint" in text
        bench.mission = other
        successor = start(
            climbing(other), epoch=2, checkpoints=checkpoints, resume=resume, versions=checkpoints.versions
        )
        bench.run(successor, until=lambda: successor.done)
    assert successor.exit_status == 0
    assert np.all(successor.coverage.first <= first)
    with StateDirectory(tmp_path) as folder:  # it is over, but its agents are still those of old
        finished = FileCheckpoints(folder, other)
        assert finished.load()[0] is None
        assert set(finished.versions) == set(checkpoints.versions)
