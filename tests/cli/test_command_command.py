"""`mpc-cover command`: what it prints, and its exit status: 0 accepted, 1 refused or no answer, 2 a mistake."""

import json
from threading import Event, Thread

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
def controller(endpoint):
    """Return a function that answers the next request; what it was asked, by its key, is in the list returned."""
    transport, threads, over = open_transport(NetworkOptions((endpoint,)), MonotonicClock(), Event()), [], Event()
    requests, asked = transport.requests(Keys("tiny").command(), 4), []
    transport.announce(Keys("tiny").controller_alive)

    def answer(accepted):
        while not over.wait(0.01):
            for request in requests.drain():
                asked.append(request.key)
                fields = {"request": decode_request(request.payload).request, "phase": Phase.WAITING}
                request.reply(encode(CommandReply(accepted=accepted, text="so it is", **fields)))

    def start(*, accepted):
        threads.append(Thread(target=answer, args=(accepted,)))
        threads[-1].start()
        return asked

    yield start
    over.set()
    for thread in threads:
        thread.join()
    transport.close()


@pytest.mark.parametrize("name", ["pause", "resume", "abort", "finish"])
def test_what_is_said_reaches_the_controller(run, tiny, controller, endpoint, name):
    asked = controller(accepted=True)
    assert run("command", name, tiny, "-e", endpoint) == (0, "so it is\n", "")
    assert asked == [Keys("tiny").command(name)]


@pytest.mark.parametrize("accepted", [True, False])
def test_json_is_all_there_is_on_stdout(run, tiny, controller, endpoint, accepted):
    controller(accepted=accepted)
    status, out, err = run("command", "pause", tiny, "-e", endpoint, "--json")
    assert (status, err) == (0 if accepted else 1, "so it is\n")
    assert json.loads(out) == {"mission": "tiny", "accepted": accepted, "phase": "waiting", "text": "so it is"}


def test_a_refusal_and_nobody_there(run, tiny, controller, endpoint):
    controller(accepted=False)
    assert run("command", "resume", tiny, "-e", endpoint) == (1, "", "so it is\n")
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    status, out, err = run("command", "resume", tiny, "-e", nowhere, "--connect-timeout", "0.1")
    assert (status, out) == (1, "")
    assert err.startswith(f"mpc-cover: network: cannot reach {nowhere}")


def test_what_is_no_command(refused):
    assert "command 'explode': is none: must be one of pause, resume, abort, finish" in refused(
        "command", "explode", "box-3"
    )
