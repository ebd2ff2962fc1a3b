"""What each role may say and hear: Zenoh's access control, where all is denied that is not allowed here.

Who a message is from is told by the certificate of the connection that it came by. Whoever listens enforces this:
a router, or the controller where it listens itself. Zenoh matches declarations by the pattern that they are for, so
patterns of the rules have to include those that `keys` makes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpc_cover.service.credentials.roles import CONTROLLER, OPERATOR, ROUTER, VIEWER
from mpc_cover.service.protocol.keys import ANY, Keys

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

HISTORY = "@adv/**"
"""Below each key: where publishers announce themselves and their history is asked for."""
EVERYTHING = ("cover/**", f"cover/**/{HISTORY}")

WRITES = ("put", "delete")
PUBLISHES = ("declare_queryable", "reply", "liveliness_token")
"""What else a publisher with a history does, below its key."""
HEARS = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
DECLARATIONS = ("declare_subscriber", "declare_queryable", "query", *HEARS[2:], "liveliness_token")
"""What tells others what one is interested in, and nothing of what is said."""


def access_control(agents: Sequence[str]) -> dict[str, Any]:
    """Return Zenoh's access control for a fleet of agents; everything else is denied."""
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    for role in (*agents, CONTROLLER, OPERATOR, VIEWER, ROUTER):
        own = _rules_of(role)
        rules += own
        subjects.append({"id": role, "cert_common_names": [role]})
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rules_of(role: str) -> list[dict[str, Any]]:
    """Return the rules of a role: what may come from it, and what may go to it."""
    keys = Keys(ANY)
    if role == ROUTER:  # between routers: the agents' and the controller's signatures say what is genuine
        return [_rule(role, "all", ("ingress", "egress"), (*WRITES, *PUBLISHES, *HEARS), EVERYTHING)]
    own, heard, asked = _keys_of(role, keys)
    tokens = _tokens_of(role, keys)
    alive = (keys.agent_alive(), keys.controller_alive, keys.controller_instance())
    wanted = (*_with_history(heard), *_with_history(own), *alive)
    found = [
        _rule(role, "hears", ("ingress",), HEARS, wanted),
        _rule(role, "is-told", ("egress",), (*WRITES, "reply"), (*_with_history(heard), *asked, *alive)),
        _rule(role, "is-asked", ("egress",), DECLARATIONS, EVERYTHING),
    ]
    if own:
        found.append(_rule(role, "writes", ("ingress",), WRITES, own))
        found.append(_rule(role, "remembers", ("ingress",), PUBLISHES, _with_history(own)))
    if tokens:
        found.append(_rule(role, "is-there", ("ingress",), ("liveliness_token",), tokens))
    if asked:
        found.append(_rule(role, "asks", ("ingress",), ("query",), asked))
    if role == CONTROLLER:
        found.append(_rule(role, "answers", ("ingress",), ("declare_queryable", "reply"), (keys.command(), keys.map)))
    return found


def _keys_of(role: str, keys: Keys) -> tuple[list[str], list[str], list[str]]:
    """Return what a role writes, what it hears, and what it may ask for."""
    said_by_controller = [keys.status, keys.map, keys.controller_event]
    said_by_agents = [keys.state(), keys.agent_event(), keys.hello(), keys.word()]
    if role == CONTROLLER:
        return [keys.plan(), *said_by_controller], [keys.state(), keys.agent_event()], []
    if role in {OPERATOR, VIEWER}:
        commands = [keys.command()] if role == OPERATOR else []
        return [], [*said_by_agents, *said_by_controller, keys.plan()], [*commands, keys.map]
    own = [keys.state(role), keys.agent_event(role), keys.hello(role), keys.word(role)]
    return own, [keys.plan(role), keys.hello(), keys.word(), *said_by_controller], [keys.map]


def _tokens_of(role: str, keys: Keys) -> list[str]:
    if role == CONTROLLER:
        return [keys.controller_alive, keys.controller_instance()]
    return [] if role in {OPERATOR, VIEWER} else [keys.agent_alive(role)]


def _with_history(keys: Iterable[str]) -> list[str]:
    return [each for key in keys for each in (key, f"{key}/{HISTORY}")]


def _rule(role: str, name: str, flows: Sequence[str], messages: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    return {
        "id": f"{role} {name}",
        "permission": "allow",
        "flows": list(flows),
        "messages": list(messages),
        "key_exprs": list(keys),
    }
