"""`mpc-cover bench maps`: what it prints, and how many steps it takes."""

import json


def test_a_step_of_the_maps_is_measured(run, refused):
    status, out, err = run("bench", "maps", "--steps", "2", "--json")
    assert status == 0, err
    report = json.loads(out)
    assert (report["cells"], report["agents"]) == (317**2, 50)
    assert len(report["maps"]) == 10
    assert all(0.0 < row["p50_ms"] <= row["p99_ms"] for row in report["maps"])
    assert "--steps 0: must be from 1 to" in refused("bench", "maps", "--steps", "0")
