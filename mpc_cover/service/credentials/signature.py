"""Signs messages and verifies them: Ed25519 over the key that a message goes to and its exact bytes.

A signed message is the JSON of the message with one more field at its end, which whoever looks for no signature skips.
What is verified is what stands before that field, and that alone is decoded afterwards.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cryptography.exceptions import InvalidSignature

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

_BEFORE, _AFTER = b',"signature":"', b'"}'
_DIGITS = 128
"""Of a signature in hexadecimal: 64 bytes."""
SIGNATURE_BYTES = len(_BEFORE) + _DIGITS + len(_AFTER) - 1
"""How much longer a signed message is."""


class SignatureError(Exception):
    """A message is not signed, or not by whom it should be; the text says which."""


def sign(key: Ed25519PrivateKey, topic: str, payload: bytes) -> bytes:
    """Return a message, a JSON object with at least one field, signed for a topic."""
    assert payload.endswith(b"}"), "only JSON objects are signed"
    return payload[:-1] + _BEFORE + key.sign(_statement(topic, payload)).hex().encode() + _AFTER


def is_signed(payload: bytes) -> bool:
    """Return whether a message bears a signature, of whoever it may be."""
    begin = len(payload) - len(_AFTER) - _DIGITS
    return begin > len(_BEFORE) and payload.endswith(_AFTER) and payload[begin - len(_BEFORE) : begin] == _BEFORE


def verify(key: Ed25519PublicKey, topic: str, payload: bytes) -> bytes:
    """Return what was signed, a JSON object, without the signature.

    Raises
    ------
    SignatureError
        It is not signed, or by another key, or for another topic, or has been changed since.
    """
    if not is_signed(payload):
        raise SignatureError("not signed")
    begin = len(payload) - len(_AFTER) - _DIGITS
    body = payload[: begin - len(_BEFORE)] + b"}"
    try:
        key.verify(bytes.fromhex(payload[begin : begin + _DIGITS].decode("ascii")), _statement(topic, body))
    except (InvalidSignature, ValueError):
        raise SignatureError("wrongly signed") from None
    return body


def _statement(topic: str, payload: bytes) -> bytes:
    return topic.encode() + b"\n" + payload
