"""Real Zenoh on loopback: what the rest of the service relies on."""

import socket
from threading import Event, Thread

import pytest
from service_fakes import until

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.bus import NoAnswerError, RequestError, TransportError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.processes import free_port

KEY = "cover/m/agent/a1/plan"


@pytest.fixture
def endpoint():
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def join(endpoint):
    """Return a function that joins the network; the first to join listens."""
    joined = []

    def join(**options):
        options = options or ({"connect": (endpoint,)} if joined else {"listen": (endpoint,)})
        joined.append(open_transport(NetworkOptions(**options), MonotonicClock(), Event()))
        return joined[-1]

    yield join
    for transport in joined:
        transport.close()


def test_what_is_published_arrives_with_its_key_and_time(join):
    here, there = join(), join()
    inbox = here.inbox("cover/m/agent/*/state", 8)
    publisher = there.publisher("cover/m/agent/a1/state", bus.Quality("INTERACTIVE_HIGH"))

    def arrives():
        publisher.publish(b"payload")
        return inbox.drain()

    before = MonotonicClock().now()
    first = until(arrives)[0]
    assert (first.key, first.payload) == ("cover/m/agent/a1/state", b"payload")
    assert before <= first.received_s <= MonotonicClock().now()


def test_who_comes_late_gets_the_past(join):
    here = join()
    publisher = here.publisher(KEY, bus.Quality("DATA", history=3))
    for number in range(5):
        publisher.publish(b"%d" % number)
    inbox = join().inbox(KEY, 8, history=3)
    got = []
    until(lambda: got.extend(inbox.drain()) or len(got) >= 3)
    assert [item.payload for item in got] == [b"2", b"3", b"4"]


def test_a_full_inbox_drops_the_oldest_and_counts(join):
    here, there = join(), join()
    inbox = here.inbox(KEY, 2, history=1)
    publisher = there.publisher(KEY, bus.PLAN)

    def overflows():
        publisher.publish(b"x")
        return inbox.dropped

    assert until(overflows) >= 1
    assert len(inbox.drain()) <= 2


def test_liveliness_comes_and_goes(join):
    here, there = join(), join()
    presence = here.presence("cover/m/agent/*/alive")
    there.announce("cover/m/agent/a1/alive")
    until(lambda: presence.alive() == {"cover/m/agent/a1/alive"})
    there.close()
    until(lambda: not presence.alive())
    there.close()


def test_requests_are_answered_by_a_later_tick(join):
    here, there = join(), join()
    requests = here.requests("cover/m/ctl/cmd/*", 4)

    def answer():
        for _ in range(2):
            (request,) = until(requests.drain)
            (request.fail if request.payload == b"bad" else request.reply)(b"re " + request.payload)

    answering = Thread(target=answer)
    answering.start()
    assert there.ask("cover/m/ctl/cmd/pause", b"good", 10.0) == b"re good"
    with pytest.raises(RequestError, match="re bad"):
        there.ask("cover/m/ctl/cmd/pause", b"bad", 10.0)
    answering.join()


def test_a_request_is_asked_again_until_somebody_is_there_to_answer(join):
    here, there = join(), join()
    answers = []
    asking = Thread(target=lambda: answers.append(there.ask("cover/m/ctl/cmd/pause", b"early", 20.0)))
    asking.start()
    with pytest.raises(RequestError, match="no answer"):  # nobody answers this one, asked in the meantime
        there.ask("cover/m/ctl/cmd/resume", b"", 0.3)
    requests = here.requests("cover/m/ctl/cmd/pause", 4)
    (request,) = until(requests.drain)
    request.reply(b"late")
    asking.join()
    assert answers == [b"late"]


@pytest.mark.parametrize("somebody_is_there", [False, True])
def test_a_request_that_nobody_answers(join, somebody_is_there):
    here, there = join(), join()
    requests = here.requests("cover/m/ctl/cmd/*", 4) if somebody_is_there else None
    if requests is not None:
        until(lambda: _reaches(there, requests))
    with pytest.raises(NoAnswerError, match=r"no answer within 0\.2 s"):
        there.ask("cover/m/ctl/cmd/pause", b"", 0.2)


def _reaches(there, requests):
    with pytest.raises(NoAnswerError):
        there.ask("cover/m/ctl/cmd/resume", b"", 0.05)
    return requests.drain()


def test_a_lost_link_is_made_again(join, endpoint):
    first, there = join(), join()
    inbox = there.inbox(KEY, 8, history=1)
    presence = there.presence("cover/m/ctl/alive")
    first.close()
    again = join(listen=(endpoint,))
    again.announce("cover/m/ctl/alive")
    until(presence.alive)
    again.publisher(KEY, bus.PLAN).publish(b"after")
    assert until(inbox.drain)[0].payload == b"after"


def test_what_is_larger_than_any_message_of_ours_does_not_arrive(join):
    here, there = join(), join()
    inbox = here.inbox(KEY, 8, history=1)
    publisher = there.publisher(KEY, bus.PLAN)

    def arrives():
        publisher.publish(b"x" * (MAX_PAYLOAD + 1))
        publisher.publish(b"small")
        return inbox.drain()

    assert {item.payload for item in until(arrives)} == {b"small"}


def test_an_exception_in_a_callback_is_counted(join, monkeypatch):
    here, there = join(), join()
    inbox = here.inbox(KEY, 8, history=1)
    monkeypatch.setattr(inbox, "put", lambda _: 1 / 0)
    publisher = there.publisher(KEY, bus.PLAN)

    def counted():
        publisher.publish(b"x")
        return here.callback_errors

    assert until(counted)


def test_after_closing_nothing_is_published_and_nothing_raised(join):
    here = join()
    publisher = here.publisher(KEY, bus.PLAN)
    here.close()
    publisher.publish(b"x")


def refused(**options):
    with pytest.raises(TransportError) as caught:
        open_transport(NetworkOptions(**options), MonotonicClock(), Event())
    text = str(caught.value)
    assert "\n" not in text
    assert ".rs" not in text
    return text


def test_a_port_in_use_is_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        assert "the port is in use: choose another one with -l/--listen" in refused(listen=(endpoint,))


def test_an_address_of_another_machine_is_told():
    assert "cannot listen on tcp/192.0.2.1:7474" in refused(listen=("tcp/192.0.2.1:7474",), insecure=True)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:{}", "tcp/nowhere.invalid:{}"])
def test_an_unreachable_endpoint_is_told_after_a_bounded_wait(endpoint):
    where = endpoint.format(free_port())
    assert f"cannot reach {where} within 0.1 s" in refused(connect=(where,), connect_timeout_s=0.1, insecure=True)


def test_a_signal_ends_the_wait_for_an_endpoint(endpoint):
    stop = Event()
    stop.set()
    with pytest.raises(InterruptedError):
        open_transport(NetworkOptions(connect=(endpoint,)), MonotonicClock(), stop)


@pytest.mark.parametrize(
    "content", ["{mode: ", '{mod: "peer"}', '{mode: "queen"}', "{listen: {endpoints: 7}}", "\x00", None]
)
def test_a_bad_configuration_file_is_told(tmp_path, content):
    path = tmp_path / "zenoh.json5"
    if content is not None:
        path.write_text(content)
    assert f"network configuration {path}: cannot be used" in refused(config=path)


def test_a_configuration_file_is_used_and_options_go_before_it(tmp_path, join, endpoint):
    path = tmp_path / "zenoh.json5"
    path.write_text('{mode: "peer", listen: {endpoints: ["tcp/127.0.0.1:1"]}, transport: {link: {tx: {lease: 2000}}}}')
    here = join(config=path, listen=(endpoint,))
    there = join(connect=(endpoint,))
    presence = here.presence("cover/m/ctl/alive")
    there.announce("cover/m/ctl/alive")
    until(presence.alive)
