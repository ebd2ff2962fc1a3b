"""A whole study: resumed, broken off, flown by several processes, and what it leaves behind."""

import base64
import io
import json
import re
from html.parser import HTMLParser

import matplotlib.image
import pytest
import yaml
from rich.console import Console
from study_fixtures import TINY, fly_nothing, fly_to_death, never

from mpc_cover.errors import UserError
from mpc_cover.studies.executors import LocalExecutor
from mpc_cover.studies.grid import Grid
from mpc_cover.studies.horizon import run_study
from mpc_cover.studies.measure import fly
from mpc_cover.view import study as view_study


@pytest.fixture
def study(tmp_path, monkeypatch):
    """Return a function that runs a study of the tiny mission: its result, what it printed, the seeds it flew.

    Figures are drawn where a test asks for them.
    """
    draw = view_study.study_figures
    mission = tmp_path / "tiny.yaml"
    mission.write_text(yaml.safe_dump(TINY))

    def study(fly=fly_nothing, crew=None, command="mpc-cover study horizon tiny", *, drawn=False, **changes):
        monkeypatch.setattr(view_study, "study_figures", draw if drawn else lambda _: iter(()))
        flown = []

        def counting(run):
            flown.append((run.controller, run.seed))
            return fly(run)

        text = io.StringIO()
        grid = Grid(**{"missions": (str(mission),), "horizons": ("8",), "seeds": 3, **changes})
        console = Console(file=text, width=100)
        result = run_study(
            grid, tmp_path / "out", crew or LocalExecutor(1), console, command=command, fly=fly if crew else counting
        )
        return result, text.getvalue(), flown

    study.out = tmp_path / "out"
    return study


def test_a_real_study_flies_measures_and_reports(study):
    result, said, _ = study(fly=fly, drawn=True, seeds=1, controllers=("mpc", "sweep", "potential"))
    assert result.exit_status == 0
    assert [group.label for group in result.groups["tiny"]] == ["mpc 4 s", "potential", "sweep"]
    assert all(group.complete_percent == 100.0 for group in result.groups["tiny"])
    assert all(file.is_file() for file in result.files)
    assert {"report.html", "runs.parquet", "runs.csv", "pareto.png"} < {file.name for file in result.files}
    assert "tiny: swath bound" in said
    assert "mpc 4 s" in said


def test_a_study_that_is_done_flies_nothing_more(study):
    study()
    result, said, flown = study()
    assert flown == []
    assert result.exit_status == 0
    assert "3 runs, 3 of them already there" in said


def test_more_seeds_or_controllers_add_runs(study):
    study()
    assert study(seeds=5)[2] == [("mpc", 3), ("mpc", 4)]
    result, _, flown = study(controllers=("mpc", "sweep"))
    assert flown == [("sweep", 0), ("sweep", 1), ("sweep", 2)]
    assert (result.wanted, result.finished) == (6, 6)
    assert [len(group.records) for group in result.groups["tiny"]] == [5, 3]


def test_ctrl_c_keeps_what_is_finished_and_the_same_command_goes_on(study):
    def interrupted(run):
        if run.seed == 2:
            raise KeyboardInterrupt
        return fly_nothing(run)

    result, said, _ = study(fly=interrupted)
    assert result.exit_status == 130
    assert result.interrupted
    assert (result.wanted, result.finished) == (3, 2)
    assert "stopped: 2 of 3 runs are finished; the same command goes on from there" in said
    assert (study.out / "report.html").is_file()
    assert study()[2] == [("mpc", 2)]


def test_ctrl_c_before_the_first_run_leaves_no_report(study):
    def interrupted(run):
        raise KeyboardInterrupt

    assert study(fly=interrupted)[0].exit_status == 130
    assert not (study.out / "report.html").exists()
    assert study()[0].exit_status == 0


def test_a_killed_study_goes_on_where_it_was(study):
    class Killed(BaseException):
        pass

    def killed(run):
        if run.seed == 1:
            raise Killed
        return fly_nothing(run)

    with pytest.raises(Killed):
        study(fly=killed)
    assert len(list((study.out / "runs").iterdir())) == 1
    assert study()[2] == [("mpc", 1), ("mpc", 2)]


def test_a_run_that_broke_off_is_told_and_flown_again(study, capsys):
    def broken(run):
        return never(run, error="RuntimeError: no") if run.seed == 1 else fly_nothing(run)

    result, said, _ = study(fly=broken)
    assert result.exit_status == 1
    assert result.broken == 1
    assert "seed 1: broke off, took 0.0 s: RuntimeError: no" in capsys.readouterr().err
    assert "1 broke off" in said
    result, _, flown = study()
    assert flown == [("mpc", 1)]
    assert (result.exit_status, result.broken) == (0, 0)


def test_processes_of_this_machine_share_the_work(study, capsys):
    result, _, _ = study(crew=LocalExecutor(2))
    assert result.exit_status == 0
    assert [record.seed for record in result.groups["tiny"][0].records] == [0, 1, 2]
    assert "3 of 3 runs" in capsys.readouterr().err


def test_a_process_that_is_killed_is_a_clear_error(study):
    with pytest.raises(UserError, match=r"a process of the study was killed.*: what is finished is kept"):
        study(fly=fly_to_death, crew=LocalExecutor(2))
    assert study()[0].exit_status == 0


def test_mistakes_leave_nothing_behind(study):
    with pytest.raises(UserError, match="--seeds 0"):
        study(seeds=0)
    assert not study.out.exists()


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.cells, self._bad = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.links += [given[name] for name in ("src", "href") if name in given]
        self._bad = tag == "td" and given.get("class") == "bad"

    def handle_data(self, data):
        if self._bad:
            self.cells.append(data)
        self._bad = False


def test_the_report_needs_no_other_file(study):
    study(command="mpc-cover study horizon '<tiny>' --out out", drawn=True)
    text = (study.out / "report.html").read_text()
    page = Page(text)
    assert len(page.links) == 4
    for link in page.links:
        assert link.startswith("data:image/png;base64,")
        image = matplotlib.image.imread(io.BytesIO(base64.b64decode(link.split(",")[1])))
        assert min(image.shape[:2]) > 300
    assert "http" not in re.sub(r"base64,[^\"]+", "", text)
    assert "&#x27;&lt;tiny&gt;&#x27; --out out" in text
    assert re.search(r"mpc_cover \S+, numpy \S+", text)
    assert page.cells == []


def test_the_report_marks_what_should_not_be(study):
    study(fly=lambda run: never(run, violations=2, separation_margin_m=-0.1, misses=1))
    cells = Page((study.out / "report.html").read_text()).cells
    assert cells == ["0", "never / never", "never / never", "-0.100", "6 in 3", "31.9, 3 late"]


def test_the_result_is_plain_data(study):
    result, _, _ = study(fly=never)
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["groups"][0]["complete_percent"] == 0.0
    assert data["groups"][0]["median_time_to_99_s"] is None
    assert data["files"][0].endswith("report.html")


def test_what_is_left_is_estimated(study, capsys):
    study(seeds=1)
    study(seeds=2)
    assert "1 of 1 runs, about 0 s left; tiny mpc 4 s, seed 1: " in capsys.readouterr().err
