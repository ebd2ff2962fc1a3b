"""`mpc-cover retask`: what it prints, and its exit status: 0 accepted, 1 refused or no answer, 2 a mistake."""

import json
from threading import Event, Thread

import numpy as np
import pytest

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.protocol.decoding import decode_request
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandReply, Phase, encode
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.processes import free_port


@pytest.fixture
def endpoint():
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def network(endpoint):
    """What listens at the endpoint."""
    transport = open_transport(NetworkOptions(listen=(endpoint,)), MonotonicClock(), Event())
    yield transport
    transport.close()


@pytest.fixture
def controller(network):
    """Return a function that answers the next request as it is told, after it was asked `skip` times."""
    requests, over, asked, threads = network.requests(Keys("tiny").command(), 4), Event(), [], []
    network.announce(Keys("tiny").controller_alive)

    def answer(accepted, text, problems, skip):
        while not over.wait(0.01):
            for request in requests.drain():
                asked.append(decode_request(request.payload))
                if len(asked) > skip:
                    fields = {"request": asked[-1].request, "phase": Phase.WAITING, "problems": problems}
                    request.reply(encode(CommandReply(accepted=accepted, text=text, **fields)))

    def start(accepted, text, problems=(), skip=0):
        threads.append(Thread(target=answer, args=(accepted, text, list(problems), skip)))
        threads[-1].start()
        return asked

    yield start
    over.set()
    for thread in threads:
        thread.join()


def test_what_was_accepted_is_said(run, tiny, controller, endpoint):
    asked = controller(accepted=True, text="retask: done")
    assert run("retask", tiny, "-e", endpoint) == (0, "retask: done\n", "")
    assert json.loads(asked[0].mission)["name"] == "tiny"


def test_what_was_refused_is_one_message_with_every_problem(run, tiny, controller, endpoint):
    controller(accepted=False, text="retask: refused", problems=["fleet.agents: x: y", "control.period_s: 1.0: z"])
    status, out, err = run("retask", tiny, "-e", endpoint)
    assert (status, out) == (1, "")
    assert err == ("mpc-cover: mission tiny: retask: refused\n  fleet.agents: x: y\n  control.period_s: 1.0: z\n")


@pytest.mark.parametrize("accepted", [True, False])
def test_json_is_all_there_is_on_stdout(run, tiny, controller, endpoint, accepted):
    controller(accepted=accepted, text="retask: so", problems=["a: b: c"])
    status, out, _ = run("retask", tiny, "-e", endpoint, "--json")
    assert status == (0 if accepted else 1)
    said = {"accepted": accepted, "phase": "waiting", "text": "retask: so", "problems": ["a: b: c"]}
    assert json.loads(out) == {"mission": "tiny", **said}


def test_a_controller_that_is_there_but_busy_is_asked_again(run, tiny, controller, endpoint):
    asked = controller(accepted=True, text="retask: at last", skip=1)
    assert run("retask", tiny, "-e", endpoint, "--connect-timeout", "1") == (0, "retask: at last\n", "")
    assert len({request.request for request in asked}) == 1, "the same request, so that it is obeyed once"


def test_nobody_at_the_endpoint(run, tiny, endpoint):
    status, out, err = run("retask", tiny, "-e", endpoint, "--connect-timeout", "0.1")
    assert (status, out) == (1, "")
    assert err.startswith(f"mpc-cover: network: cannot reach {endpoint} within 0.1 s")
    assert err.count("\n") == 1


def test_no_controller_of_this_mission(run, tiny, network, endpoint):
    status, out, err = run("retask", tiny, "-e", endpoint, "--connect-timeout", "0.1")
    assert (status, out) == (1, "")
    assert err.startswith("mpc-cover: no controller of mission tiny answers within 1 s: is `mpc-cover serve` up")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-e", "localhost:7447"), "must look like tcp/"),
        (("--config", "none.json5"), "network configuration none.json5"),
        (("--connect-timeout", "nan"), "--connect-timeout nan"),
    ],
)
def test_a_network_that_is_none(refused, tiny, options, words):
    assert words in refused("retask", tiny, *options)


def test_a_mission_that_is_too_large_to_be_sent(refused, mission, tmp_path, endpoint):
    np.save(tmp_path / "weights.npy", np.full((400, 400), 0.123456789))
    message = refused("retask", mission(area__weights={"file": "weights.npy"}), "-e", endpoint)
    assert "bytes: must be at most 1048576 to be sent: a coarser area.weights helps" in message
