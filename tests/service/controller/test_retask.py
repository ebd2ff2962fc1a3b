"""Another version of a mission for the same fleet: what may change, and what of the map still holds."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_kinds import KINDS, mission_with
from service_fakes import small_mission
from sweep_laws import StraightSweepLaw

from mpc_cover.information.build import make_map
from mpc_cover.mission.load import load_mission as load
from mpc_cover.mission.load import mission_from_json, shipped_missions
from mpc_cover.service.controller.retask import carry_over, consider_retask, retask_problems
from mpc_cover.service.protocol.fingerprint import mission_hash

NOW_S = 20.0


def version(mission, **changes):
    """Return a mission with some fields changed; dots are written as two underscores, None leaves a field out."""
    raw = json.loads(mission.to_json())
    for path, value in changes.items():
        *above, last = path.split("__")
        here = raw
        for key in above:
            here = here[int(key)] if isinstance(here, list) else here.setdefault(key, {})
        if value is None:
            del here[last]
        else:
            here[last] = value
    return mission_from_json(json.dumps(raw), "version")


def box(min_x, min_y, max_x, max_y):
    return {"kind": "box", "min_m": [min_x, min_y], "max_m": [max_x, max_y]}


@pytest.mark.parametrize("file", shipped_missions(), ids=lambda file: file.stem)
def test_a_mission_that_was_sent_is_the_one_in_the_file(file):
    mission = load(file)
    assert mission_hash(mission_from_json(mission.to_json(), "sent")) == mission_hash(mission)


# what may change

BOX = {"area__motion_min_m": [0.0, 0.0], "area__motion_max_m": [3.0, 4.0]}


def paths(current, other, time_s=0.0):
    return [problem.path for problem in retask_problems(current, other, time_s)]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"area__shape": box(0.0, 0.5, 2.5, 3.0)},
        {"area__shape": {"kind": "disc", "center_m": [1.5, 2.0], "radius_m": 1.2}, **BOX},
        {"area__cell_size_m": 0.2, "area__looks": 3},
        {"area__weights": {"values": [[1.0, 0.0], [2.0, 1.0]]}},
        {"information": KINDS["ageing"], "control__time_limit_s": 50.0, "control__planning_time_s": 9.0},
        {"fleet__agents__0__start_m": [1.0, 3.0], "fleet__agents__1__start_m": [2.0, 3.0]},
        {"fleet__agents__0__speed_max_m_per_s": 1.0},  # as the defaults have it
        {"planning__duration_s": 99.0},
    ],
)
def test_what_agents_need_not_know_may_change(changes):
    mission = small_mission()
    assert not paths(mission, version(mission, **changes))


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"name": "other"}, "name"),
        ({"fleet__agents": [{"id": "a1", "start_m": [0.75, 0.5]}]}, "fleet.agents"),
        ({"fleet__agents__1__speed_max_m_per_s": 1.1}, "fleet.agents.1.speed_max_m_per_s"),
        ({"fleet__agents__0__input_max_m_per_s2": 0.9}, "fleet.agents.0.input_max_m_per_s2"),
        ({"fleet__agents__1__sensing_radius_m": 1.2}, "fleet.agents.1.sensing_radius_m"),
        ({"fleet__separation_min_m": 0.4}, "fleet.separation_min_m"),
        ({"fleet__communication_range_m": None}, "fleet.communication_range_m"),
        ({"fleet__links": [["a1", "a2"]]}, "fleet.links"),
        ({"fleet__faults_tolerated": 1}, "fleet.faults_tolerated"),
        ({"fleet__dynamics": "single"}, "fleet.dynamics"),
        ({"magnitudes": ["heat"]}, "magnitudes"),
        ({"control__period_s": 0.4}, "control.period_s"),
        ({"control__horizon_steps": 9}, "control.horizon_steps"),
        ({"control__state_period_s": 0.05}, "control.state_period_s"),
        ({"disturbance__position_noise_m": 0.01}, "disturbance.position_noise_m"),
        ({"area__shape": box(0.0, 0.0, 3.0, 4.5)}, "area.motion_max_m"),
        ({"area__motion_min_m": [-0.1, 0.0]}, "area.motion_min_m"),
        ({"control__time_limit_s": NOW_S}, "control.time_limit_s"),
    ],
)
def test_what_agents_rely_on_must_stay(changes, path):
    mission = small_mission()
    assert paths(mission, version(mission, **changes), NOW_S) == [path]


def test_everything_that_is_wrong_is_said_at_once():
    mission = small_mission()
    other = version(mission, control__period_s=0.4, area__motion_min_m=[-1.0, 0.0], fleet__separation_min_m=0.1)
    assert set(paths(mission, other)) == {"area.motion_min_m", "fleet.separation_min_m", "control.period_s"}


def test_a_box_may_shrink_and_then_not_grow_again():
    wide, narrow = small_mission(), version(small_mission(), area__shape=box(0.0, 0.0, 3.0, 2.0))
    assert not paths(wide, narrow)
    assert paths(narrow, wide) == ["area.motion_max_m"]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"schema": 1}', "[" * 5000, '{"schema": 1, "name": 7}'])
def test_what_is_no_mission_is_refused_in_words(text):
    mission = small_mission()
    retask, decision = consider_retask(text, mission, make_map(mission), 0.0, StraightSweepLaw)
    assert retask is None
    assert not decision.accepted
    assert decision.problems or "holds no readable mission" in decision.text


def test_a_law_that_cannot_be_made_is_refused_in_words():
    mission = small_mission()

    def fails(_):
        raise MemoryError("too many cells")

    text = version(mission, area__cell_size_m=0.1).to_json()
    retask, decision = consider_retask(text, mission, make_map(mission), 0.0, fails)
    assert (retask, decision.accepted, decision.text) == (None, False, "refused: MemoryError('too many cells')")


def test_the_mission_that_is_flown_is_no_news():
    mission = small_mission()
    retask, decision = consider_retask(mission.to_json(), mission, make_map(mission), 0.0, StraightSweepLaw)
    assert retask is None
    assert decision.accepted


# what of the map still holds


def flown(mission, seed, steps=12):
    """Return the map of a mission after a random flight, a report every 0.1 s, up to NOW_S."""
    rng, coverage = np.random.default_rng(seed), make_map(mission)
    position = rng.uniform(0.0, 4.0, (mission.fleet.size, 2))
    for step in range(steps):
        position = position + rng.normal(0.0, 0.2, position.shape)
        coverage.observe(NOW_S - 0.1 * (steps - step), position)
    return coverage


def states_equal(first, second, cells=slice(None), others=slice(None)):
    assert set(first) == set(second)
    for name in first.keys() - {"recent", "clock"}:
        np.testing.assert_allclose(first[name][:, cells], second[name][:, others], rtol=1e-12, err_msg=name)


@given(kind=st.sampled_from(sorted(KINDS)), seed=st.integers(0, 999))
def test_onto_itself_it_is_the_identity(kind, seed):
    mission = mission_with(KINDS[kind])
    state = flown(mission, seed).state()
    carried = carry_over(mission, state, mission, NOW_S)
    states_equal(state, carried)
    for name in state.keys() & {"recent", "clock"}:
        np.testing.assert_array_equal(state[name], carried[name])


@given(kind=st.sampled_from(sorted(KINDS)), seed=st.integers(0, 999), shift=st.floats(0.01, 0.49))
def test_onto_shifted_cells_nothing_carries(kind, seed, shift):
    mission = mission_with(KINDS[kind])
    other = version(mission, area__shape=box(shift, 0.0, 4.0, 4.0), area__motion_min_m=[0.0, 0.0])
    state = flown(mission, seed).state()
    carried, empty = (carry_over(mission, each, other, NOW_S) for each in (state, make_map(mission).state()))
    states_equal(carried, empty)
    assert carried.get("recent", np.empty((3, 0))).shape[1] == 0
    coverage = make_map(other)
    coverage.restore(carried)
    assert coverage.covered_count == 0


@given(kind=st.sampled_from(sorted(KINDS.keys() - {"kalman"})), seed=st.integers(0, 999))
def test_on_common_cells_it_is_as_if_the_new_map_had_been_there_all_along(kind, seed):
    mission = mission_with(KINDS[kind])
    other = version(
        mission, area__shape=box(2.0, 0.5, 5.0, 4.0), area__motion_min_m=[0.0, 0.0], area__motion_max_m=[5.0, 4.0]
    )
    carried = carry_over(mission, flown(mission, seed).state(), other, NOW_S)
    common = other.field.cell[:, 0] < 4.0
    states_equal(
        *({k: v for k, v in s.items() if k != "lap"} for s in (carried, flown(other, seed).state())), common, common
    )
    unknown = carry_over(mission, make_map(mission).state(), other, NOW_S)
    states_equal(carried, unknown, ~common, ~common)


def test_a_look_that_was_taken_just_now_counts_only_once():
    mission = mission_with(KINDS["looks"])
    other = version(mission, area__shape=box(2.0, 0.5, 4.0, 4.0), area__motion_min_m=[0.0, 0.0])
    before = make_map(mission)
    position = np.array([[3.0, 3.0], [2.5, 1.0]])
    before.observe(NOW_S, position)
    coverage = make_map(other)
    coverage.restore(carry_over(mission, before.state(), other, NOW_S))
    coverage.observe(NOW_S + 0.1, position)
    assert coverage.covered_count == 0
    coverage.observe(NOW_S + 0.5, position)
    assert coverage.covered_count > 0


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("other", sorted(KINDS))
def test_looks_that_mean_something_else_do_not_carry(kind, other):
    mission, wanted = mission_with(KINDS[kind]), mission_with(KINDS[other])
    carried = carry_over(mission, flown(mission, 3).state(), wanted, NOW_S)
    empty = carry_over(wanted, make_map(wanted).state(), wanted, NOW_S)
    known = any((carried[name] != empty[name]).any() for name in empty.keys() - {"recent", "clock", "last"})
    assert known == (kind == other)


@pytest.mark.parametrize(
    ("kind", "field", "value"),
    [("effective", "peak", 2.0), ("effective", "rim", 0.2), ("kalman", "noise_variance", 2.0)],
)
def test_another_sensor_knows_nothing(kind, field, value):
    mission, wanted = mission_with(KINDS[kind]), mission_with({**KINDS[kind], field: value})
    carried = carry_over(mission, flown(mission, 3).state(), wanted, NOW_S)
    states_equal(carried, make_map(wanted).state())


@pytest.mark.parametrize(
    ("kind", "field", "less", "more"),
    [("looks", "looks", 2, 4), ("effective", "level", 0.3, 2.5), ("kalman", "target_variance", 0.9, 0.2)],
)
def test_where_less_is_asked_cells_are_settled_now_and_where_more_is_asked_they_are_owed(kind, field, less, more):
    mission = mission_with({**KINDS[kind], field: 3 if kind == "looks" else KINDS[kind][field]})
    coverage = flown(mission, 5)
    settled = coverage.settled
    easier, harder = (recast(mission, coverage, {**KINDS[kind], field: value}) for value in (less, more))
    for after in (easier, harder):
        assert (after.residual.any(axis=0) == ~after.settled).all()
    assert not (harder.settled & ~settled).any()
    assert not (settled & ~easier.settled).any()
    assert (easier.settled & ~settled).any()
    assert (easier.covered_at[easier.settled & ~settled] == NOW_S).all()
    assert (easier.covered_at[settled] == coverage.covered_at[settled]).all()


def recast(mission, coverage, information):
    """Return a map for another kind of information in the same area, with what this one knows."""
    wanted = mission_with(information)
    after = make_map(wanted)
    after.restore(carry_over(mission, coverage.state(), wanted, NOW_S))
    return after


def test_a_simulated_field_that_is_stretched_over_another_area_is_measured_anew():
    mission = mission_with(KINDS["kalman"])
    other = version(mission, area__shape=box(0.0, 0.0, 4.0, 3.0), area__motion_max_m=[4.0, 4.0])
    states_equal(carry_over(mission, flown(mission, 3).state(), other, NOW_S), make_map(other).state())


def test_a_patrol_grows_no_older_than_its_area():
    mission = mission_with(KINDS["ageing"])
    other = version(mission, area__shape=box(0.1, 0.0, 4.0, 4.0), area__motion_min_m=[0.0, 0.0])
    coverage = make_map(other)
    coverage.restore(carry_over(mission, flown(mission, 3).state(), other, NOW_S))
    assert coverage.covered_count == 0
    assert coverage.residual.max() == 0.0, "nothing is overdue before it could be"
