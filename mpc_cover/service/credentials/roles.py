"""The roles of a fleet, and the files in which the credentials of one lie."""

from __future__ import annotations

CONTROLLER = "controller"
OPERATOR = "operator"
VIEWER = "viewer"
ROUTER = "router"
SERVICE_ROLES = (CONTROLLER, OPERATOR, VIEWER, ROUTER)
"""The roles that every fleet has; the others are its agents, each named by its id."""

CA_FOLDER = "ca"
"""Where the key is that makes all the others: it belongs on no machine of the fleet."""
CA_FILE = "ca.pem"
CERTIFICATE_FILE = "certificate.pem"
KEY_FILE = "key.pem"
SIGNING_KEY_FILE = "signing-key.pem"
SIGNERS_FILE = "signers.json"
"""The public halves of all signing keys, by role."""


def signs(role: str) -> bool:
    """Return whether a role says anything that others act upon: agents, the controller, the operator."""
    return role not in {VIEWER, ROUTER}
