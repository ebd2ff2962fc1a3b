"""Reads the credentials of one role, and says what is wrong with them before the network would, without a word."""

from __future__ import annotations

import datetime as dt
import json
import stat
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID

from mpc_cover.errors import UserError
from mpc_cover.service.credentials import roles

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes


SOON = dt.timedelta(days=7)
"""How long before they expire credentials are warned of; a plain choice."""


class CredentialsError(UserError):
    """Credentials that are missing, damaged, expired, or somebody else's."""


@dataclass(frozen=True)
class Credentials:
    """Who a process is, and whom it believes.

    Attributes
    ----------
    folder : where the certificate, its key and that of the authority lie, for TLS.
    fleet, role : of whom they are: the controller, an agent by its id, the operator, a viewer, a router.
    hosts : the names and addresses at which it may listen.
    signers : the keys that messages are signed with, by role.
    signing_key : its own; None for who says nothing that others act upon.
    """

    folder: Path
    fleet: str
    role: str
    hosts: tuple[str, ...]
    signers: Mapping[str, Ed25519PublicKey]
    signing_key: Ed25519PrivateKey | None

    @property
    def agents(self) -> tuple[str, ...]:
        """The ids of the fleet's agents."""
        return tuple(role for role in self.signers if role not in roles.SERVICE_ROLES)

    def require(self, role: str, what: str) -> None:
        """Check that these are the credentials of a role, which `what` needs.

        Raises
        ------
        CredentialsError
            They are of another one.
        """
        if self.role != role:
            right = f"give the folder {role} of fleet {self.fleet}"
            raise CredentialsError(f"credentials {self.folder}: are those of {self.role}: {what} needs others: {right}")


def load_credentials(folder: Path, warn: Callable[[str], None]) -> Credentials:
    """Return the credentials in a folder, one of those that `keys new` makes; `warn` is told of lesser matters.

    Raises
    ------
    CredentialsError
        Something is missing, unreadable, expired, or does not belong to the rest.
    """
    if not folder.is_dir():
        right = "must be the folder of a role, as `mpc-cover keys new` makes them"
        raise CredentialsError(f"credentials {folder}: there is no such folder: {right}")
    if not (folder / roles.CERTIFICATE_FILE).exists() and (folder / roles.CA_FOLDER).is_dir():
        found = ", ".join(sorted(path.name for path in folder.iterdir() if path.is_dir() and path.name != "ca"))
        raise CredentialsError(f"credentials {folder}: is a whole fleet's: give the folder of one role: {found}")
    authority = _certificate(folder / roles.CA_FILE)
    certificate = _certificate(folder / roles.CERTIFICATE_FILE)
    key = _private_key(folder / roles.KEY_FILE, warn)
    if key.public_key() != certificate.public_key():
        raise CredentialsError(f"credentials {folder}: {roles.KEY_FILE} is not the key of {roles.CERTIFICATE_FILE}")
    _check_issuer(folder, certificate, authority)
    role = _common_name(certificate)
    signers = _signers(folder / roles.SIGNERS_FILE)
    signing_key = _signing_key(folder, role, signers, warn)
    _warn_of_expiry(folder, min(certificate.not_valid_after_utc, authority.not_valid_after_utc), warn)
    return Credentials(folder.absolute(), _fleet(authority), role, _hosts(certificate), signers, signing_key)


def _warn_of_expiry(folder: Path, end: dt.datetime, warn: Callable[[str], None]) -> None:
    """Warn of credentials that will soon hold no longer."""
    if end - dt.datetime.now(dt.UTC) < SOON:
        warn(f"credentials {folder}: hold only until {end:%Y-%m-%d %H:%M} UTC: connections end then")


def _certificate(path: Path) -> x509.Certificate:
    """Return a certificate that is valid now."""
    data = _read(path)
    try:
        certificate = x509.load_pem_x509_certificate(data)
    except ValueError:
        raise CredentialsError(f"credentials {path}: is no certificate (PEM)") from None
    now = dt.datetime.now(dt.UTC)
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if now > end:
        when = end.strftime("%Y-%m-%d %H:%M UTC")
        raise CredentialsError(f"credentials {path}: has expired on {when}: make new ones with `mpc-cover keys new`")
    if now < begin:
        when = begin.strftime("%Y-%m-%d %H:%M UTC")
        raise CredentialsError(f"credentials {path}: holds only from {when} on: is the clock of this machine right?")
    return certificate


def _check_issuer(folder: Path, certificate: x509.Certificate, authority: x509.Certificate) -> None:
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        own, other = _fleet(certificate), _fleet(authority)
        whose = f"fleet {own}, and {roles.CA_FILE} of fleet {other}" if own != other else "another making of the fleet"
        text = f"{roles.CERTIFICATE_FILE} is of {whose}: copy one whole folder of one `keys new`"
        raise CredentialsError(f"credentials {folder}: {text}") from None


def _signers(path: Path) -> dict[str, Ed25519PublicKey]:
    data = _read(path)
    try:
        found = {
            str(role): Ed25519PublicKey.from_public_bytes(bytes.fromhex(key)) for role, key in json.loads(data).items()
        }
    except (ValueError, AttributeError, TypeError):
        raise CredentialsError(f"credentials {path}: is no list of signing keys, by role") from None
    if roles.CONTROLLER not in found:
        raise CredentialsError(f"credentials {path}: has no key of the {roles.CONTROLLER}")
    return found


def _signing_key(
    folder: Path, role: str, signers: Mapping[str, Ed25519PublicKey], warn: Callable[[str], None]
) -> Ed25519PrivateKey | None:
    if not roles.signs(role):
        return None
    path = folder / roles.SIGNING_KEY_FILE
    key = _private_key(path, warn)
    if not isinstance(key, Ed25519PrivateKey) or signers.get(role) != key.public_key():
        raise CredentialsError(f"credentials {path}: is not the key that {roles.SIGNERS_FILE} has for {role}")
    return key


def _private_key(path: Path, warn: Callable[[str], None]) -> PrivateKeyTypes:
    data = _read(path)
    try:
        key = load_pem_private_key(data, None)
    except (ValueError, TypeError):
        raise CredentialsError(f"credentials {path}: is no private key (PEM, without a password)") from None
    mode = path.stat().st_mode
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        warn(f"credentials {path}: others may read this key (mode {stat.S_IMODE(mode):o}): chmod 600 {path}")
    return key


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise CredentialsError(f"credentials {path}: is missing: copy the whole folder of a role") from None
    except OSError as error:
        raise CredentialsError(f"credentials {path}: cannot be read: {error.strerror}") from None


def _common_name(certificate: x509.Certificate) -> str:
    found = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""


def _hosts(certificate: x509.Certificate) -> tuple[str, ...]:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return tuple(str(name.value) for name in names)


def _fleet(certificate: x509.Certificate) -> str:
    found = certificate.subject.get_attributes_for_oid(NameOID.ORGANIZATION_NAME)
    return str(found[0].value) if found else "unknown"
