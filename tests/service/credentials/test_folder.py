"""Credentials that are missing, damaged, expired or somebody else's: one clear sentence each."""

import datetime as dt
import shutil

import pytest
from cryptography import x509
from fleet_keys import load, make_fleet, warned

from mpc_cover.service.credentials.folder import CredentialsError, load_credentials


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make_fleet(tmp_path_factory.mktemp("made"))


@pytest.fixture(scope="module")
def strangers(tmp_path_factory):
    return make_fleet(tmp_path_factory.mktemp("strangers"), name="strangers")


@pytest.fixture
def fleet(made, tmp_path):
    """A fleet of the test's own, to damage."""
    return shutil.copytree(made, tmp_path / "fleet")


def refused(folder):
    with pytest.raises(CredentialsError) as caught:
        load_credentials(folder, warned)
    text = str(caught.value)
    assert text.startswith(f"credentials {folder}")
    assert "\n" not in text
    return text


def test_what_each_role_gets(made):
    controller, agent, viewer = load(made, "controller"), load(made, "a1"), load(made, "viewer")
    assert (agent.fleet, agent.role, agent.agents) == ("fleet", "a1", ("a1", "a2"))
    assert set(viewer.signers) == {"a1", "a2", "controller", "operator"}
    assert viewer.signing_key is None
    assert controller.signing_key.public_key() == agent.signers["controller"]
    assert agent.signing_key.public_key() == viewer.signers["a1"]


def test_nobody_else_may_read_a_private_key(made):
    private = [*made.glob("*/key.pem"), *made.glob("*/signing-key.pem")]
    assert len(private) == 7 + 4
    assert {path.stat().st_mode & 0o777 for path in private} == {0o600}
    assert {path.parent.stat().st_mode & 0o777 for path in private} == {0o700}


def test_a_key_that_others_may_read_is_warned_of(fleet):
    (fleet / "a1" / "key.pem").chmod(0o644)
    said = []
    load_credentials(fleet / "a1", said.append)
    assert said == [
        f"credentials {fleet}/a1/key.pem: others may read this key (mode 644): chmod 600 {fleet}/a1/key.pem"
    ]


def test_a_folder_that_is_not_there_and_one_of_a_whole_fleet(made):
    assert "there is no such folder" in refused(made / "a9")
    assert "give the folder of one role: a1, a2, controller, operator, router, viewer" in refused(made)


def test_credentials_that_will_soon_expire_are_warned_of(fleet):
    said = []
    load_credentials(make_fleet(fleet / "short", days=6.9) / "a1", said.append)
    assert len(said) == 1
    assert f"credentials {fleet}/short/a1: hold only until 20" in said[0]


FILES = ["ca.pem", "certificate.pem", "key.pem", "signing-key.pem", "signers.json"]


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_missing(fleet, name):
    (fleet / "a1" / name).unlink()
    assert f"{name}: is missing: copy the whole folder of a role" in refused(fleet / "a1")


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("content", [b"", b"junk", b"[]", b'{"controller": "ab"}', b"\xff\x00"])
def test_a_file_that_is_damaged(fleet, name, content):
    (fleet / "a1" / name).write_bytes(content)
    assert f"{name}: is no " in refused(fleet / "a1")


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_cannot_be_read(fleet, name):
    (fleet / "a1" / name).unlink()
    (fleet / "a1" / name).mkdir()
    assert f"{name}: cannot be read: Is a directory" in refused(fleet / "a1")


@pytest.mark.parametrize("name", ["certificate.pem", "ca.pem"])
def test_a_certificate_of_another_fleet(fleet, strangers, name):
    shutil.copy(strangers / "a1" / name, fleet / "a1" / name)
    if name == "certificate.pem":
        shutil.copy(strangers / "a1" / "key.pem", fleet / "a1" / "key.pem")
    text = refused(fleet / "a1")
    assert "of fleet strangers" in text
    assert "copy one whole folder of one `keys new`" in text


def test_a_certificate_of_another_making_of_the_same_fleet(fleet, tmp_path):
    again = make_fleet(tmp_path / "again")
    shutil.copy(again / "a1" / "ca.pem", fleet / "a1" / "ca.pem")
    assert "is of another making of the fleet" in refused(fleet / "a1")


def test_a_key_of_another_certificate(fleet):
    shutil.copy(fleet / "a2" / "key.pem", fleet / "a1" / "key.pem")
    assert "key.pem is not the key of certificate.pem" in refused(fleet / "a1")


@pytest.mark.parametrize("name", ["a2/signing-key.pem", "a1/key.pem"])
def test_a_signing_key_of_another_role(fleet, name):
    shutil.copy(fleet / name, fleet / "a1" / "signing-key.pem")
    assert "is not the key that signers.json has for a1" in refused(fleet / "a1")


def test_an_expired_certificate_and_one_that_holds_later(fleet, monkeypatch):
    text = refused(make_fleet(fleet / "old", days=-0.001) / "a1")
    assert "ca.pem: has expired on 20" in text
    assert "make new ones with `mpc-cover keys new`" in text
    begins = x509.load_pem_x509_certificate((fleet / "a1" / "ca.pem").read_bytes()).not_valid_before_utc

    class Earlier(dt.datetime):
        @classmethod
        def now(cls, tz=None):
            return begins - dt.timedelta(days=1)

    monkeypatch.setattr(dt, "datetime", Earlier)
    assert "is the clock of this machine right?" in refused(fleet / "a1")
