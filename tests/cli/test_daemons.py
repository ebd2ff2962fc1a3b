"""`mpc-cover serve` and `mpc-cover agent`: what each of them alone refuses."""

from mpc_cover.service.controller.state_directory import StateDirectory


def test_an_unknown_agent(refused):
    message = refused("agent", "box-3", "--id", "a9")
    assert "'a9'" in message
    assert "its agents are a1, a2, a3" in message


def test_a_state_directory_that_another_controller_uses(refused, tmp_path):
    with StateDirectory(tmp_path / "state"):
        assert "another controller uses it" in refused("serve", "box-3", "--state-dir", "state")


def test_a_record_that_cannot_be_written(refused):
    assert "cannot be written" in refused("agent", "box-3", "--id", "a1", "--record", "no/where.jsonl")
