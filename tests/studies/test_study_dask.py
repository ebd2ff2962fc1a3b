"""A study on a Dask cluster, and clusters that are not there."""

import builtins
from types import SimpleNamespace

import pytest
from study_fixtures import fly_nothing, tiny_run

from mpc_cover.errors import UserError
from mpc_cover.studies.executors import DaskExecutor


class Future:
    def __init__(self, outcome):
        self.outcome = outcome

    def cancelled(self):
        return self.outcome is None

    def exception(self):
        return self.outcome if isinstance(self.outcome, Exception) else None

    def result(self):
        return self.outcome


class Client:
    """Runs what is submitted at once; loses seed 1, and with `gone` the whole cluster at seed 2."""

    loop = None

    def __init__(self, *, gone=False):
        self.gone, self.cancelled = gone, []

    def submit(self, fly, run, *, pure):
        assert not pure
        if run.seed == 1:
            return Future(RuntimeError("worker lost"))
        return Future(None if self.gone and run.seed == 2 else fly(run))

    def cancel(self, futures):
        self.cancelled += futures


@pytest.fixture
def crew(monkeypatch):
    """Return a function that makes a crew with such a client."""

    def crew(client):
        distributed = SimpleNamespace(as_completed=lambda futures, loop: iter(futures))
        monkeypatch.setitem(__import__("sys").modules, "distributed", distributed)
        made = DaskExecutor("tcp://127.0.0.1:1")
        made._client = client
        return made

    return crew


def test_each_run_comes_back_and_a_lost_one_as_one_that_broke_off(crew):
    client = Client()
    runs = [tiny_run(seed=seed) for seed in range(3)]
    records = list(crew(client).fly(runs, fly_nothing))
    assert [record.error for record in records] == ["", "RuntimeError: worker lost", ""]
    assert [record.key for record in records] == [run.key for run in runs]
    assert client.cancelled == []


def test_a_cluster_that_goes_away_is_a_clear_error(crew):
    flight = crew(Client(gone=True)).fly([tiny_run(seed=seed) for seed in (0, 2)], fly_nothing)
    assert next(flight).seed == 0
    with pytest.raises(UserError, match=r"the cluster went away: what is finished is kept"):
        next(flight)


def test_what_still_waits_is_cancelled_when_nobody_wants_it(crew):
    client = Client()
    flight = crew(client).fly([tiny_run(seed=seed) for seed in (0, 2)], fly_nothing)
    next(flight)
    flight.close()
    assert len(client.cancelled) == 1


def test_without_dask_the_error_says_how_to_get_it(monkeypatch):
    real = builtins.__import__

    def missing(name, *rest, **given):
        if name == "distributed":
            raise ImportError(name)
        return real(name, *rest, **given)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(UserError, match=r"pip install 'mpc-cover\[dask\]'"), DaskExecutor("tcp://127.0.0.1:1"):
        pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "", "x://y:1"])
def test_nobody_at_the_address_is_a_clear_error(address):
    pytest.importorskip("dask.distributed")
    crew = DaskExecutor(address, timeout_s=0.2)
    with pytest.raises(UserError, match=f"--dask {address}: no Dask scheduler answers there: "), crew:
        pass


@pytest.mark.slow
def test_a_real_cluster_flies():
    distributed = pytest.importorskip("dask.distributed")
    runs = [tiny_run(seed=seed) for seed in range(3)]
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        DaskExecutor(cluster.scheduler_address) as crew,
    ):
        records = list(crew.fly(runs, fly_nothing))
    assert sorted(record.seed for record in records) == [0, 1, 2]
