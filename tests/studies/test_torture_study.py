"""Tortures: what is clean stays clean, faults are shrunk, folders go on."""

import pytest
from tiny_mission import TINY

from mpc_cover.mission.load import build_mission
from mpc_cover.service.torture.faults import CONTROLLER, Fault, FaultKind
from mpc_cover.studies import torture_runs
from mpc_cover.studies.executors import LocalExecutor
from mpc_cover.studies.progress import CountedProgress
from mpc_cover.studies.torture import recording_of, replay, run_torture, worst_ratio
from mpc_cover.studies.torture_runs import flight_of, shrunk
from mpc_cover.verification.check import check_trajectory
from mpc_cover.view.progress import ProgressLine

CONTROL = {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 1.0}
MISSION = build_mission({**TINY, "control": CONTROL}, "tiny")
CLEAN = [
    FaultKind.DUPLICATES,
    FaultKind.CLOCKS,
    FaultKind.STOPS,
    FaultKind.RESTARTS,
    FaultKind.TAKEOVERS,
    FaultKind.SLOW,
    FaultKind.TWINS,
    FaultKind.SOLVER,
    FaultKind.DISK,
]
"""Kinds of faults under which no violation is known in this mission."""


def quiet(total):
    return CountedProgress(total, "flights", ProgressLine(None))


def tortured(out, kinds, seeds, **options):
    return run_torture(MISSION, kinds, seeds, out, LocalExecutor(1), progress=quiet, **options)


def test_a_round_of_every_kind_that_is_clean_stays_clean(tmp_path):
    """What continuous integration flies: three seeds of each kind."""
    result = tortured(tmp_path / "t", CLEAN, range(3 * len(CLEAN)))
    assert not result.violating, [(record.seed, record.violations) for record in result.violating]
    assert result.exit_status == 0
    assert len({record.digest for record in result.records}) == len(result.records)
    assert sum(record.finished for record in result.records) >= len(result.records) - 1
    median, worst = worst_ratio(result.records, result.clean)
    assert 0.9 < median <= worst


@pytest.fixture
def fragile(monkeypatch):
    """A flight counts as violating something whenever a2 dies or is cut off for longer than a second."""
    tries = []

    class Outcome:
        def __init__(self, faults):
            long = (FaultKind.DEATHS, FaultKind.CUTS)
            bad = [
                f for f in faults if f.kind in long and "a2" in f.targets and (f.duration_s > 1.0 or not f.duration_s)
            ]
            self.violations = [torture_runs.Violation("separation", 1.0)] if bad else []

    def flown(mission, faults, seed, backend):
        tries.append(tuple(faults))
        return Outcome(faults)

    monkeypatch.setattr(torture_runs, "flight_of", flown)
    return tries


def test_faults_are_left_out_and_shortened_as_far_as_the_violation_stays(fragile):
    loss = Fault(FaultKind.LOSS, 0.0, 1e6, share=0.3)
    cut = Fault(FaultKind.CUTS, 2.0, 9.0, ("a2",))
    stop = Fault(FaultKind.STOPS, 4.0, 2.0, (CONTROLLER,))
    told = []
    left = shrunk(MISSION, [loss, cut, stop], 1, "native", on_try=lambda number, text: told.append((number, text)))
    assert [(fault.kind, fault.duration_s) for fault in left] == [(FaultKind.CUTS, 9.0 / 8.0)]
    assert [number for number, _ in told] == list(range(1, len(fragile)))


def test_a_seed_without_violation_is_replayed_once_and_its_motion_passes_the_verifier():
    found = replay(
        MISSION, [FaultKind.DUPLICATES], 4, "native", shrink=True, on_try=lambda number, text: pytest.fail(text)
    )
    assert found.fewest == found.faults
    again = flight_of(MISSION, found.faults, 4, "native")
    assert again.digest == found.outcome.digest
    assert check_trajectory(recording_of(MISSION, found.outcome, 4, "native")).holds


def test_a_torn_record_is_flown_again_and_nothing_else(tmp_path):
    kinds = [FaultKind.CLOCKS]
    first = tortured(tmp_path / "t", kinds, range(2))
    (tmp_path / "t" / "seeds" / "1.json").write_text('{"seed": 1, "ki', encoding="utf-8")
    kept = (tmp_path / "t" / "seeds" / "0.json").stat().st_mtime_ns
    again = tortured(tmp_path / "t", kinds, range(2))
    assert [record.digest for record in again.records] == [record.digest for record in first.records]
    assert (tmp_path / "t" / "seeds" / "0.json").stat().st_mtime_ns == kept
