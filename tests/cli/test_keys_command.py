"""`mpc-cover keys new`, and what `--credentials` and `--insecure` refuse: one sentence, exit status 2."""

import shutil
from pathlib import Path

import pytest
from cryptography import x509

from mpc_cover.service.credentials.folder import load_credentials


@pytest.fixture
def fleet(run, tmp_path):
    assert run("keys", "new", "barn", "--agents", "a1,a2,a3")[0] == 0
    return tmp_path / "keys" / "barn"


def test_a_folder_for_each_role_that_can_be_used_as_it_is(run, tmp_path):
    status, out, err = run("keys", "new", "barn", "--mission", "box-3")
    assert (status, err) == (0, "")
    assert "keys of fleet barn for 365 days: controller, router, operator, viewer, a1, a2, a3" in out
    folder = tmp_path / "keys" / "barn"
    roles = {path.name for path in folder.iterdir()} - {"ca"}
    assert roles == {"controller", "router", "operator", "viewer", "a1", "a2", "a3"}
    said = []
    found = {role: load_credentials(folder / role, said.append) for role in roles}
    assert {role: each.role for role, each in found.items()} == {role: role for role in roles}
    assert not said


def test_nothing_is_overwritten_unasked(run, fleet, tmp_path):
    before = (fleet / "a1" / "key.pem").read_bytes()
    assert "keys/barn-2" in run("keys", "new", "barn", "--agents", "a1")[1]
    status, _, err = run("keys", "new", "barn", "--agents", "a1", "--out", "keys/barn")
    assert status == 2
    assert "is there already: give another --out, or --overwrite" in err
    assert (fleet / "a1" / "key.pem").read_bytes() == before
    assert run("keys", "new", "barn", "--agents", "a1", "--out", "keys/barn", "--overwrite")[0] == 0
    assert (fleet / "a1" / "key.pem").read_bytes() != before
    load_credentials(fleet / "a1", print)


def test_who_may_listen_where_and_for_how_long(run, tmp_path):
    options = ("--host", "10.0.0.1", "--host", "base.example", "--host", "a1=10.0.0.7", "--days", "2")
    run("keys", "new", "barn", "--agents", "a1,a2", *options)

    def certificate(role):
        return x509.load_pem_x509_certificate((tmp_path / "keys" / "barn" / role / "certificate.pem").read_bytes())

    def hosts(role):
        try:
            names = certificate(role).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        except x509.ExtensionNotFound:
            return set()
        return {str(name.value) for name in names}

    assert hosts("controller") == hosts("router") == {"localhost", "127.0.0.1", "::1", "10.0.0.1", "base.example"}
    assert (hosts("a1"), hosts("a2"), hosts("operator")) == ({"10.0.0.7"}, set(), set())
    held = certificate("a1").not_valid_after_utc - certificate("a1").not_valid_before_utc
    assert 2 * 86_400 <= held.total_seconds() < 2 * 86_400 + 1000


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("a b", "--agents", "a1"), "fleet 'a b': must be letters"),
        (("f",), "name the agents by --agents"),
        (("f", "--agents", "a1", "--mission", "box-3"), "name the agents by --agents"),
        (("f", "--agents", "a1,"), "--agents: '': must be letters"),
        (("f", "--agents", "a1,../b"), "--agents: '../b': must be letters"),
        (("f", "--agents", "a1,a1"), "must be there only once"),
        (("f", "--agents", "a1,controller"), "agent 'controller': an agent that is to have keys must not be called so"),
        (("f", "--agents", "CA"), "must not be called so"),
        (("f", "--agents", "a1", "--days", "0"), "--days 0: must be greater than 0"),
        (("f", "--agents", "a1", "--days", "nan"), "--days nan: must be greater than 0"),
        (("f", "--agents", "a1", "--days", "1e9"), "36500 at most"),
        (("f", "--agents", "a1", "--host", "tcp/10.0.0.1:7"), "--host tcp/10.0.0.1:7: must be a name or an address"),
        (("f", "--agents", "a1", "--host", "a9=10.0.0.1"), "there is no role 'a9'"),
        (("f", "--agents", "a1", "--host", "a1="), "must be a name or an address"),
        (("f", "--mission", "none.yaml"), "none.yaml"),
        (("f", "--agents", "a1", "--out", "/proc/keys"), "--out /proc/keys: cannot be written"),
    ],
)
def test_what_keys_cannot_be_made_for(refused, options, words):
    assert words in refused("keys", "new", *options)


SERVICES = [
    ("serve", "box-3"),
    ("agent", "box-3", "--id", "a1"),
    ("retask", "box-3"),
    ("command", "abort", "box-3"),
    ("router",),
]
WHO = {"serve": "controller", "agent": "a1", "retask": "operator", "command": "operator", "router": "router"}


@pytest.mark.parametrize("command", SERVICES, ids=lambda command: command[0])
def test_credentials_that_cannot_be_used(refused, fleet, command):
    own = fleet / WHO[command[0]]
    assert "there is no such folder" in refused(*command, "--credentials", "nowhere")
    assert "is a whole fleet's: give the folder of one role" in refused(*command, "--credentials", fleet)
    message = refused(*command, "--credentials", fleet / "viewer")
    assert f"are those of viewer: {command[0]}" in message
    assert f"needs others: give the folder {own.name} of fleet barn" in message
    shutil.copy(fleet / "viewer" / "key.pem", own / "key.pem")
    assert "key.pem is not the key of certificate.pem" in refused(*command, "--credentials", own)
    (own / "ca.pem").unlink()
    assert "ca.pem: is missing" in refused(*command, "--credentials", own)


@pytest.mark.parametrize("command", SERVICES, ids=lambda command: command[0])
def test_what_does_not_go_with_credentials(refused, fleet, command):
    own = ("--credentials", fleet / WHO[command[0]])
    message = refused(*command, *own, "-e", "tcp/127.0.0.1:7474")
    assert "endpoint 'tcp/127.0.0.1:7474': with --credentials it must be tls/127.0.0.1:7474" in message
    weaker = "tls/127.0.0.1:7474#enable_mtls=false"
    assert "must leave to --credentials what it says of certificates" in refused(*command, *own, "-e", weaker)
    assert "--insecure: leave it out with --credentials" in refused(*command, *own, "--insecure")


def test_an_agent_needs_the_credentials_of_its_own_id(refused, fleet):
    message = refused("agent", "box-3", "--id", "a1", "--credentials", fleet / "a2")
    assert "are those of a2: agent --id a1 needs others: give the folder a1 of fleet barn" in message


@pytest.mark.parametrize("command", SERVICES, ids=lambda command: command[0])
@pytest.mark.parametrize("endpoint", ["tcp/192.0.2.1:7474", "tcp/0.0.0.0:7474", "tcp/[::]:7474", "tls/base.example:1"])
def test_off_loopback_credentials_are_asked_for(refused, command, endpoint):
    message = refused(*command, "-e", endpoint)
    assert f"endpoint '{endpoint}' to connect to" in message
    assert "give --credentials DIR, or --insecure if that is wanted" in message
    if command[0] not in {"retask", "command"}:
        assert "another machine can listen in, and steer the fleet" in refused(*command, "-l", endpoint)


@pytest.mark.parametrize(
    "content",
    [
        '{listen: {endpoints: ["tcp/0.0.0.0:7474"]}}',
        '{listen: {endpoints: {peer: ["tcp/192.0.2.1:7474"]}}}',
        '{mode: "peer"}',  # listens on every interface
        "{scouting: {multicast: {enabled: true}}, listen: {endpoints: []}}",
        '{mode: "client", connect: {endpoints: ["tcp/192.0.2.1:7474"]}}',
    ],
)
def test_off_loopback_by_way_of_a_configuration_as_well(refused, content):
    Path("zenoh.json5").write_text(content)
    assert "give --credentials DIR, or --insecure" in refused("agent", "box-3", "--id", "a1", "--config", "zenoh.json5")
