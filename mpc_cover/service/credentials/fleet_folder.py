"""Writes the credentials of a new fleet: a folder for each role, to be copied to the machine that has that role."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from mpc_cover.errors import UserError
from mpc_cover.service.credentials import roles
from mpc_cover.service.credentials.issuing import certificate_pem, issue, new_authority, private_pem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

PRIVATE_FILE, PUBLIC_FILE, FOLDER = 0o600, 0o644, 0o700
"""Modes of what is written: nobody else may read a private key."""


def write_fleet(
    folder: Path, fleet: str, agents: Sequence[str], hosts: Mapping[str, Sequence[str]], days: float
) -> None:
    """Make an authority and all credentials of a fleet, for some days.

    Parameters
    ----------
    agents : the ids of the agents.
    hosts : by role, the names and addresses at which it may listen.

    Raises
    ------
    UserError
        A file cannot be written.
    """
    authority = new_authority(fleet, days)
    everyone = (*agents, *roles.SERVICE_ROLES)
    signing_keys = {role: Ed25519PrivateKey.generate() for role in everyone if roles.signs(role)}
    signers = json.dumps({role: _public_hex(key) for role, key in signing_keys.items()}, indent=1).encode()
    ca = certificate_pem(authority.certificate)
    files: dict[str, tuple[bytes, int]] = {
        f"{roles.CA_FOLDER}/{roles.CA_FILE}": (ca, PUBLIC_FILE),
        f"{roles.CA_FOLDER}/{roles.KEY_FILE}": (private_pem(authority.key), PRIVATE_FILE),
    }
    for role in everyone:
        certificate, key = issue(authority, role, hosts.get(role, ()), days)
        files[f"{role}/{roles.CA_FILE}"] = ca, PUBLIC_FILE
        files[f"{role}/{roles.CERTIFICATE_FILE}"] = certificate_pem(certificate), PUBLIC_FILE
        files[f"{role}/{roles.KEY_FILE}"] = private_pem(key), PRIVATE_FILE
        files[f"{role}/{roles.SIGNERS_FILE}"] = signers, PUBLIC_FILE
        if role in signing_keys:
            files[f"{role}/{roles.SIGNING_KEY_FILE}"] = private_pem(signing_keys[role]), PRIVATE_FILE
    for name, (data, mode) in files.items():
        _write(folder / name, data, mode)


def _public_hex(key: Ed25519PrivateKey) -> str:
    return key.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw).hex()


def _write(path: Path, data: bytes, mode: int) -> None:
    """Write a file that has its mode from the first moment on."""
    try:
        path.parent.mkdir(mode=FOLDER, parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(data)
    except OSError as error:
        raise UserError(f"--out {path}: cannot be written: {error.strerror}") from None
