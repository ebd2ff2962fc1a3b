"""box-3 with some changes, as a file; QUICK is flown and planned in a second or two."""

import yaml

from mpc_cover.mission.load import shipped_missions

BOX_3 = next(path for path in shipped_missions() if path.stem == "box-3")

QUICK = {
    "name": "quick",
    "area__shape": {"kind": "box", "min_m": [1.0, 1.0], "max_m": [5.0, 5.0]},
    "control__planning_time_s": 1.0,
}


def write_mission(file, changes):
    """Write box-3 with some changes; dots are written as two underscores."""
    raw = yaml.safe_load(BOX_3.read_text(encoding="utf-8"))
    for path, value in changes.items():
        *parents, last = path.split("__")
        here = raw
        for part in parents:
            here = here[int(part) if part.isdigit() else part]
        here[last] = value
    file.write_text(yaml.safe_dump(raw), encoding="utf-8")
    return file
