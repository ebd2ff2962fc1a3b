"""Who may say what, over real TLS on loopback: what is not allowed does not arrive, and what is does.

A message that does not arrive proves nothing by itself: each test lets one that is allowed follow it on the same
connection, and looks when that one is there.
"""

import shutil
from dataclasses import replace
from threading import Event, Thread

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from fleet_keys import join as join_fleet
from fleet_keys import load, make_fleet
from service_fakes import until

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.credentials.issuing import Authority, certificate_pem, issue, private_pem
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.bus import NoAnswerError, RequestError, TransportError, UnreachableError
from mpc_cover.service.protocol.decoding import MAX_PAYLOAD
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.processes import free_port

KEYS = Keys("m")
MARK = b'{"schema":1}'


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return make_fleet(tmp_path_factory.mktemp("keys"))


@pytest.fixture
def endpoint():
    return f"tls/127.0.0.1:{free_port()}"


@pytest.fixture
def join(fleet, endpoint):
    """Return a function that joins the network in a role; the first to join listens."""
    joined = []

    def join(role, *, of=fleet, **options):
        where = {"connect": [endpoint]} if joined else {"listen": [endpoint]}
        joined.append(join_fleet(of, role, **(options or where)))
        return joined[-1]

    yield join
    for transport in reversed(joined):
        transport.close()


def payloads(inbox):
    return [item.payload for item in inbox.drain()]


def test_each_hears_what_is_meant_for_it(join):
    controller, a1, viewer = join("controller"), join("a1"), join("viewer")
    states, presence = controller.inbox(KEYS.state(), 8, history=8), controller.presence(KEYS.agent_alive())
    publishers = [
        a1.publisher(KEYS.state("a1"), bus.STATE),
        controller.publisher(KEYS.plan("a1"), bus.PLAN),
        controller.publisher(KEYS.status, bus.STATUS),
    ]  # kept, as each remembers what it has published
    for publisher in publishers:
        publisher.publish(MARK)
    a1.announce(KEYS.agent_alive("a1", "life"))
    controller.announce(KEYS.controller_instance("c"))
    assert until(lambda: payloads(states)) == [MARK]
    assert until(presence.alive) == {KEYS.agent_alive("a1", "life")}
    for who, key in ((a1, KEYS.plan("a1")), (a1, KEYS.status), (viewer, KEYS.status), (viewer, KEYS.state("a1"))):
        inbox = who.inbox(key, 8, history=8)
        assert until(lambda inbox=inbox: payloads(inbox)) == [MARK], f"{key}, from before"
    assert until(lambda: a1.alive(KEYS.controller_instance(), 1.0)) == [KEYS.controller_instance("c")]


def test_an_agent_can_write_nothing_of_another_and_no_plan(join):
    """Signatures are left aside: what is looked at is what the connection lets pass."""
    controller, a1, a2 = join("controller"), join("a1"), join("a2")
    everything = [controller.inbox(f"{KEYS.root}/{part}", 64) for part in ("agent/*/*", "ctl/*")]
    plans, presence = a1.inbox(KEYS.plan("a1"), 8, history=1), controller.presence(KEYS.agent_alive())
    for inbox in (*everything, plans):
        inbox.verify = None
    controller.publisher(KEYS.plan("a1"), bus.PLAN).publish(b'{"by":"controller"}')
    until(lambda: payloads(plans))
    forged = (KEYS.state("a1"), KEYS.plan("a1"), KEYS.plan("a2"), KEYS.agent_event("a1"), KEYS.status, KEYS.map)
    own = a2.publisher(KEYS.state("a2"), bus.STATE)

    def arrives():
        for key in forged:
            a2.publisher(key, bus.PLAN).publish(MARK)
        for key in (KEYS.state(), KEYS.plan(), f"{KEYS.root}/**"):  # one that stands for several is no way round
            a2._inner._session.put(key, MARK)
        a2.announce(KEYS.agent_alive("a1", "forged"))
        a2.announce(KEYS.controller_instance("forged"))
        own.publish(MARK)
        a2.announce(KEYS.agent_alive("a2", "life"))
        items = [item for inbox in everything for item in inbox.drain()]
        return [item.key for item in items if b"by" not in item.payload]  # it hears itself, too

    assert set(until(arrives)) == {KEYS.state("a2")}
    assert until(presence.alive) == {KEYS.agent_alive("a2", "life")}
    assert not payloads(plans)
    assert a1.alive(KEYS.controller_instance(), 0.5) == []


def test_an_agent_does_not_overhear_the_plan_of_another(join):
    controller, a1 = join("controller"), join("a1")
    inboxes = {key: a1.inbox(key, 8, history=8) for key in (KEYS.plan("a2"), KEYS.plan(), KEYS.plan("a1"))}
    publishers = [controller.publisher(KEYS.plan(name), bus.PLAN) for name in ("a2", "a1")]

    def arrives():
        for publisher in publishers:
            publisher.publish(MARK)
        return payloads(inboxes[KEYS.plan("a1")])

    until(arrives)
    assert not payloads(inboxes[KEYS.plan("a2")])
    assert {item.key for item in inboxes[KEYS.plan()].drain()} <= {KEYS.plan("a1")}
    late = [a1.inbox(key, 8, history=8) for key in (KEYS.plan("a2"), KEYS.plan(), KEYS.plan("a1"))]
    until(lambda: payloads(late[-1]))
    assert {item.key for inbox in late for item in inbox.drain()} <= {KEYS.plan("a1")}, "not from before either"


def test_viewers_and_agents_can_command_nothing_and_the_operator_can(join):
    controller, operator, others = join("controller"), join("operator"), [join("viewer"), join("a1")]
    requests = controller.requests(KEYS.command(), 8)
    requests.verify = None
    for other in others:
        with pytest.raises(NoAnswerError):
            other.ask(KEYS.command("abort"), MARK, 0.2)
    assert requests.keys() == []
    with pytest.raises(NoAnswerError):
        operator.ask(KEYS.command("abort"), MARK, 0.3)
    assert set(requests.keys()) == {KEYS.command("abort")}


def test_a_viewer_may_ask_for_the_map_and_is_answered_by_the_controller(join):
    controller, viewer = join("controller"), join("viewer")
    requests = controller.requests(KEYS.map, 8)
    answering = Thread(target=lambda: [request.reply(MARK) for request in until(requests.drain)])
    answering.start()
    assert viewer.ask(KEYS.map, b"", 5.0) == MARK
    answering.join()


def test_through_a_router_all_is_as_without_one(join):
    join("router")
    controller, a1, a2 = join("controller"), join("a1"), join("a2")
    plans, states = a1.inbox(KEYS.plan("a1"), 8, history=1), controller.inbox(KEYS.state(), 8, history=8)
    controller.publisher(KEYS.plan("a1"), bus.PLAN).publish(MARK)
    assert until(lambda: payloads(plans)) == [MARK]
    forger, honest = a2.publisher(KEYS.state("a1"), bus.STATE), a1.publisher(KEYS.state("a1"), bus.STATE)

    def arrives():
        forger.publish(b'{"forged":1}')
        honest.publish(MARK)
        return payloads(states)

    assert set(until(arrives)) == {MARK}
    assert not states.take_refused()


def test_a_controller_that_is_started_again_is_found_by_its_agents(join, endpoint):
    former, a1 = join("controller"), join("a1")
    plans, presence = a1.inbox(KEYS.plan("a1"), 8, history=1), a1.presence(KEYS.controller_instance())
    publisher = a1.publisher(KEYS.state("a1"), bus.STATE)
    publisher.publish(MARK)
    former.close()
    again = join("controller", listen=[endpoint])
    again.announce(KEYS.controller_instance("second"))
    assert until(presence.alive) == {KEYS.controller_instance("second")}
    states = again.inbox(KEYS.state(), 8, history=8)
    assert until(lambda: payloads(states)) == [MARK], "what was measured meanwhile"
    plan = again.publisher(KEYS.plan("a1"), bus.PLAN)
    plan.publish(MARK)
    assert until(lambda: payloads(plans)) == [MARK]


def test_a_message_of_64_mib_arrives_nowhere_and_the_next_one_does(join):
    controller, a1 = join("controller"), join("a1")
    states = controller.inbox(KEYS.state(), 8)
    publisher = a1.publisher(KEYS.state("a1"), bus.STATE)
    publisher.publish(b"x" * (64 << 20))
    publisher.publish(b"x" * (MAX_PAYLOAD + 1000))

    def arrives():
        publisher.publish(MARK)
        return payloads(states)

    assert set(until(arrives)) == {MARK}
    assert states.dropped == 0
    assert not states.take_refused()


def refused(where, **options):
    with pytest.raises(UnreachableError) as caught:
        open_transport(NetworkOptions(connect=(where,), connect_timeout_s=0.2, **options), MonotonicClock(), Event())
    return str(caught.value)


def test_who_has_no_certificate_of_the_fleet_does_not_get_in(join, fleet, endpoint, tmp_path):
    join("controller")
    join("a1").close()
    assert "cannot reach" in refused(endpoint)  # none at all
    assert "cannot reach" in refused(endpoint.replace("tls", "tcp"))  # not even encrypted
    strangers = make_fleet(tmp_path / "strangers")  # of the same name, and with the same agents
    assert "of the same fleet fleet" in refused(endpoint, credentials=load(strangers, "a1"))
    impostor = shutil.copytree(strangers / "a1", tmp_path / "impostor")
    shutil.copy(fleet / "a1" / "ca.pem", impostor / "ca.pem")  # believes this fleet's controller
    assert "cannot reach" in refused(endpoint, credentials=replace(load(strangers, "a1"), folder=impostor))


def test_an_expired_certificate_does_not_get_in_either(join, fleet, endpoint, tmp_path):
    """As if the machine's own check were left out, or its clock stood still."""
    join("controller")
    folder = shutil.copytree(fleet / "a1", tmp_path / "a1")
    certificate, key = expired(fleet, "a1")
    (folder / "certificate.pem").write_bytes(certificate)
    (folder / "key.pem").write_bytes(key)
    assert "that has not expired" in refused(endpoint, credentials=replace(load(fleet, "a1"), folder=folder))


def expired(fleet, role):
    """Return a certificate that the fleet's own authority made, for a time that is over, and its key."""
    authority = Authority(
        x509.load_pem_x509_certificate((fleet / "ca" / "ca.pem").read_bytes()),
        load_pem_private_key((fleet / "ca" / "key.pem").read_bytes(), None),
    )
    certificate, key = issue(authority, role, (), -0.001)
    return certificate_pem(certificate), private_pem(key)


def test_an_agent_cannot_pose_as_the_one_that_listens(fleet, endpoint):
    """Its certificate is for no address, and not for listening, whatever its own process says to that."""
    with pytest.raises(TransportError, match="the certificate of a2 is for no address: make keys with `--host a2="):
        join_fleet(fleet, "a2", listen=[endpoint])
    credentials = replace(load(fleet, "a2"), hosts=("127.0.0.1",))
    impostor = open_transport(NetworkOptions((endpoint,), credentials=credentials), MonotonicClock(), Event())
    try:
        assert "is for this address" in refused(endpoint, credentials=load(fleet, "a1"))
    finally:
        impostor.close()


def test_an_answer_of_somebody_else_is_none(join, fleet):
    """A router that has been taken over answers a command itself."""
    router, operator = join("router"), join("operator")
    requests = router.requests(KEYS.command(), 8)
    object.__setattr__(router._credentials, "signing_key", Ed25519PrivateKey.generate())
    answering = Thread(target=lambda: [request.reply(MARK) for request in until(requests.drain)])
    answering.start()
    with pytest.raises(RequestError, match="the answer is not the controller's: wrongly signed"):
        operator.ask(KEYS.command("abort"), MARK, 5.0)
    answering.join()
