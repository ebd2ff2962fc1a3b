"""A participant that only notes when it is ticked."""

from mpc_cover.service.torture.processes import Process


class Ticking:
    """Ticks once a second of its clock; see `daemon.Participant`."""

    def __init__(self, process: Process, work_s: float = 0.0) -> None:
        self.done = False
        self.ticks: list[float] = []
        self.wall_steps_s: list[float] = []
        self.ended = False
        self._process, self._work_s = process, work_s
        self.next_time = process.clock.now()

    def startup(self) -> None:
        pass

    def tick(self) -> None:
        if self._work_s:
            self._process.wait_until(self._process.time.now_s + self._work_s)
        self.ticks.append(round(self._process.time.now_s, 9))
        self.wall_steps_s.append(self._process.time.wall_step_s)
        self.next_time += 1.0

    def shutdown(self) -> None:
        self._process.clock.now()  # whoever was killed does not get further than this
        self.ended = True


def started(time, **options) -> tuple[Process, Ticking]:
    """Return a process that ticks on virtual time."""
    work_s = options.pop("work_s", 0.0)
    process = Process("p", time, options.pop("origin_s", 0.0), **options)
    participant = Ticking(process, work_s)
    process.start(lambda: participant)
    return process, participant
