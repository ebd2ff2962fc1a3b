"""What commands share: a mistake in a mission, a back-end, a speed, a network is one message and exit status 2."""

import socket

import pytest

COMMANDS = [
    pytest.param(("simulate",), id="simulate"),
    pytest.param(("plan",), id="plan"),
    pytest.param(("demo",), id="demo"),
    pytest.param(("serve",), id="serve"),
    pytest.param(("agent", "--id", "a1"), id="agent"),
    pytest.param(("retask",), id="retask"),
    pytest.param(("command", "pause"), id="command"),
]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_missing_mission(refused, command):
    message = refused(*command, "nowhere.yaml")
    assert "no such file" in message
    assert "box-3" in message


@pytest.mark.parametrize("command", COMMANDS)
def test_a_mission_that_is_no_yaml(refused, tmp_path, command):
    (tmp_path / "bad.yaml").write_text("area: [1, 2\nfleet: }")
    assert "is not valid YAML" in refused(*command, "bad.yaml")


MISTAKES = {
    "negative radius": ({"fleet__defaults__sensing_radius_m": -1.0}, ["fleet.defaults.sensing_radius_m", "-1.0"]),
    "too close": ({"fleet__agents__1__start_m": [2.1, 2.0]}, ["fleet.agents.1.start_m", "0.1 m from a1"]),
    "not connected": ({"fleet__agents__2__start_m": [9.0, 9.0]}, ["fleet.agents.2.start_m", "is not connected"]),
    "misspelt": ({"fleet__separation_m": 1.0}, ["fleet.separation_m", "is not a known key"]),
    "several": (
        {"control__period_s": -1, "area__cell_size_m": 0, "fleet__agents__0__id": "a b"},
        ["control.period_s", "area.cell_size_m", "fleet.agents.0.id", "3 problems"],
    ),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("changes", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mission_with_mistakes(refused, mission, command, changes, words):
    message = refused(*command, mission(**changes))
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "box-3"),
        ("plan", "box-3"),
        ("demo",),
        ("serve", "box-3"),
        ("bench", "step"),
        ("study", "laws", "box-3"),
    ],
)
def test_an_unknown_back_end(refused, command):
    message = refused(*command, "--backend", "gurobi")
    for name in ("gurobi", "piqp", "osqp", "clarabel"):
        assert name in message


@pytest.mark.parametrize("command", [("demo",), ("serve", "box-3"), ("agent", "box-3", "--id", "a1")])
@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf"])
def test_a_speed_that_is_none(refused, command, speed):
    assert "must be a number greater than 0" in refused(*command, "--speed", speed)


SERVICES = [("serve", "box-3"), ("agent", "box-3", "--id", "a1")]


@pytest.mark.parametrize("command", SERVICES)
def test_a_port_in_use(refused, command):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        message = refused(*command, "-l", f"tcp/127.0.0.1:{taken.getsockname()[1]}")
    assert "the port is in use" in message


@pytest.mark.parametrize("command", SERVICES)
def test_an_unreachable_endpoint(refused, command):
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{closed.getsockname()[1]}"
        message = refused(*command, "-e", endpoint, "--connect-timeout", "0.1")
    assert f"cannot reach {endpoint} within 0.1 s" in message


@pytest.mark.parametrize("command", SERVICES)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-e", "localhost:7447"), "must look like tcp/"),
        (("-l", "tcp/127.0.0.1"), "must look like tcp/"),
        (("--config", "none.json5"), "network configuration none.json5"),
        (("--connect-timeout", "-1"), "--connect-timeout -1"),
        (("--connect-timeout", "nan"), "--connect-timeout nan"),
    ],
)
def test_a_network_that_is_none(refused, command, options, words):
    assert words in refused(*command, *options)


@pytest.mark.parametrize("command", [("simulate", "box-3"), ("demo",)])
def test_an_out_that_is_not_ours(refused, tmp_path, command):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter-1.txt").write_text("precious")
    assert "is not empty and not a run of mpc-cover" in refused(*command, "--out", "thesis")
    (tmp_path / "file").write_text("")
    assert "cannot be written" in refused(*command, "--out", "file")
    assert "cannot be written" in refused(*command, "--out", "file/run")


@pytest.mark.parametrize("command", ["simulate", "demo"])
@pytest.mark.parametrize("kill", ["a2", "a9@3", "a2@-1", "a2@soon"])
def test_deaths_that_cannot_be(refused, quick, tmp_path, command, kill):
    message = refused(command, quick, "--out", "run", "--kill", kill)
    assert "--kill" in message
    assert kill in message
    assert not (tmp_path / "run").exists()
