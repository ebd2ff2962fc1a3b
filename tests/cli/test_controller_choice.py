"""`--controller mpc|potential`: what each cannot fly is refused before anything is written."""

from pathlib import Path

import pytest
import yaml
from tiny_mission import WIDE


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "tiny.yaml", "--controller", "pid"], "--controller pid: is none: must be one of mpc, potential"),
        (["demo", "fig-5-1"], "fleet.dynamics single: plans are for double integrators"),
        (["simulate", "fig-5-1"], "fly it with --controller potential"),
        (["agent", "fig-5-1", "--id", "a1"], "fly it with --controller potential"),
        (["plan", "fig-5-1"], "fly it with --controller potential"),
        (["retask", "fig-5-1"], "fly it with --controller potential"),
        (["serve", "fig-5-1"], "fly it with --controller potential"),
        (["bench", "planner", "fig-5-1"], "fly it with --controller potential"),
        (["bench", "step", "fig-5-1"], "fly it with --controller potential"),
        (["simulate", "tiny.yaml", "--controller", "potential", "--backend", "osqp"], "solves no QP"),
        (["demo", "tiny.yaml", "--controller", "potential", "--backend", "piqp"], "solves no QP"),
        (["agent", "tiny.yaml", "--id", "zz", "--controller", "potential"], "its agents are a1, a2"),
        (["simulate", "near.yaml", "--controller", "potential"], "communication range 2 m: must be at least"),
        (["simulate", "patrol", "--controller", "potential"], "information.kind ageing"),
        (["demo", "patrol", "--controller", "potential"], "which on a patrol never is: fly it by the receding horizon"),
        (["agent", "patrol", "--id", "a1", "--controller", "potential"], "information.kind ageing"),
    ],
)
def test_what_cannot_fly_is_refused_before_anything_is_written(refused, tiny, tmp_path, arguments, message):
    near = {**WIDE, "fleet": {**WIDE["fleet"], "communication_range_m": 2.0}}
    Path("near.yaml").write_text(yaml.safe_dump(near))
    before = sorted(tmp_path.iterdir())
    assert message in refused(*arguments)
    assert sorted(tmp_path.iterdir()) == before
