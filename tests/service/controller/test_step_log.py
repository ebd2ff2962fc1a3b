"""The log of what each step took: it is read back, and no trouble with it stops the control."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import FaultyLaw

from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.service.controller.step_log import Step, StepLog, read_steps

STEP = Step("step", 1.5, 0.02, 0.025, "NEW", "replanned", deadline_missed=True)


def test_a_step_log_is_read_back_without_its_torn_line(tmp_path):
    path = tmp_path / "steps.jsonl"
    for _ in range(2):  # a second controller appends
        log = StepLog(path)
        log.add(STEP)
        log.close()
    assert (log.count, log.misses, log.last) == (1, 1, STEP)
    assert read_steps(path) == [STEP, STEP]
    path.write_bytes(path.read_bytes()[:-3])
    assert read_steps(path) == [STEP]
    path.write_bytes(b"junk\n")
    with pytest.raises(UnreadableFileError):
        read_steps(path)
    assert read_steps(tmp_path / "none") == []
    with pytest.raises(UserError, match="cannot be written"):
        StepLog(tmp_path / "no" / "steps.jsonl")


def test_a_step_log_on_a_full_disk_does_not_stop_the_control():
    class Full:
        def open(self, *_, **__):
            return self

        def write(self, _):
            raise OSError(28, "No space left on device")

        def close(self):
            pass

    log = StepLog(Full())
    log.add(STEP)
    log.add(STEP)
    assert log.count == 2


@pytest.mark.parametrize("fault", ["a time that is no number", "no samples", "no trajectory"])
def test_whatever_is_proposed_the_log_is_readable(tmp_path, fault):
    bench = Bench(small_mission(height=9.0))
    bench.agent("a1"), bench.agent("a2")
    controller = bench.controller(
        FaultyLaw(bench.mission, fault, 3, goal_y=8.5), step_log=StepLog(tmp_path / "steps.jsonl")
    )
    bench.run(controller, until=lambda: controller.done)
    controller.shutdown()
    steps = read_steps(tmp_path / "steps.jsonl")
    assert steps == list(controller.step_log.steps)
    assert [step.kind for step in steps].count("step") == 2 + 3
    np.testing.assert_allclose([step.mission_time_s for step in steps[:6]], 0.5 * np.arange(6), atol=1e-9)
