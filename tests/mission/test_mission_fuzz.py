"""Whatever stands in a mission file: a mission, or a UserError."""

from __future__ import annotations

import contextlib

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from mission_files import changed, raw_mission

from mpc_cover.errors import UserError
from mpc_cover.mission.load import build_mission, load_mission

number = st.one_of(
    st.integers(-3, 12), st.floats(), st.integers(), st.sampled_from([0, -0.0, 1e-9, 1e308, 10**400, True])
)
scalar = st.one_of(number, st.text(max_size=5), st.none(), st.binary(max_size=3), st.sampled_from(["box", "a1", "0.5"]))
point = st.lists(number, min_size=1, max_size=4)
anything = st.recursive(
    scalar,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(scalar, inner, max_size=4)),
    max_leaves=8,
)
shape = st.one_of(
    st.fixed_dictionaries({"kind": st.just("box"), "min_m": point, "max_m": point}),
    st.fixed_dictionaries({"kind": st.just("disc"), "center_m": point, "radius_m": number}),
    st.fixed_dictionaries(
        {"kind": st.just("polygon"), "outline_m": st.lists(point, min_size=2, max_size=6)},
        optional={"holes_m": st.lists(st.lists(point, min_size=2, max_size=5), max_size=2)},
    ),
)
PATHS = (
    "schema",
    "name",
    "colour",
    "magnitudes",
    "area",
    "area.shape",
    "area.cell_size_m",
    "area.motion_min_m",
    "area.motion_max_m",
    "fleet",
    "fleet.defaults",
    "fleet.defaults.sensing_radius_m",
    "fleet.defaults.input_max_m_per_s2",
    "fleet.agents",
    "fleet.agents.0",
    "fleet.agents.0.id",
    "fleet.agents.0.start_m",
    "fleet.agents.1.sensing_radius_m",
    "fleet.separation_min_m",
    "fleet.communication_range_m",
    "control",
    "control.period_s",
    "control.horizon_steps",
    "control.state_period_s",
    "planning.duration_s",
)


def small_enough(raw):
    """Whether cutting the area into cells would not take long: the largest allowed is 200,000 cells."""
    size = raw["area"].get("cell_size_m") if isinstance(raw.get("area"), dict) else None
    return not isinstance(size, float) or not 0 < size < 0.05


@given(anything)
@settings(max_examples=300)
def test_any_data_at_all(raw):
    with contextlib.suppress(UserError):
        build_mission(raw, "fuzz")


@given(st.lists(st.tuples(st.sampled_from(PATHS), st.one_of(anything, number, point, shape)), min_size=1, max_size=3))
@settings(max_examples=600)
def test_a_mission_with_a_few_values_replaced(changes):
    # deeper paths first, so that they still exist
    raw = changed(*sorted(changes, key=lambda change: -change[0].count(".")))
    if small_enough(raw):
        with contextlib.suppress(UserError):
            mission = build_mission(raw, "fuzz")
            assert mission.field.size > 0
            assert build_mission(raw, "again").to_json() == mission.to_json()


@given(shape, st.floats(0.2, 5.0))
@settings(max_examples=300)
def test_any_shape(raw, size):
    with contextlib.suppress(UserError):
        assert build_mission(changed(("area.shape", raw), ("area.cell_size_m", size)), "fuzz").field.size > 0


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "mission.yaml"


TEXT = yaml.safe_dump(raw_mission())
TOKENS = ("{", "}", "[", "]", ":", "- ", "\n", "  ", "&a ", "*a", "!!int ", "!!set ", "'", "|", "? ", "#", "~", ".nan")


@given(st.integers(0, len(TEXT)), st.integers(0, 12), st.one_of(st.sampled_from(TOKENS), st.text(max_size=4)))
@settings(max_examples=400)
def test_text_with_a_piece_replaced(file, start, length, piece):
    text = TEXT[:start] + piece + TEXT[start + length :]
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    with contextlib.suppress(UserError):
        load_mission(file)


@given(st.binary(max_size=60))
def test_any_bytes(file, content):
    file.write_bytes(content)
    with contextlib.suppress(UserError):
        load_mission(file)
