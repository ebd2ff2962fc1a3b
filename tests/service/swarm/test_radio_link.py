"""An agent's radio hears those in range, and whatever else arrives is counted and harmless."""

import numpy as np
from fleet_keys import load, make_fleet
from swarm_ground import Ground
from swarm_missions import swarm_mission

from mpc_cover.information.delay import adjacency
from mpc_cover.service.credentials.signature import sign, verify
from mpc_cover.service.protocol.bus import Quality
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.signed_transport import SignedTransport
from mpc_cover.service.run.swarm_simulate import fly_swarm
from mpc_cover.service.swarm.radio_messages import Codec

HISTORYLESS = Quality("DATA")


def test_nobody_believes_who_is_out_of_range():
    """Whoever an agent says that it has heard was within rho_C at that sample."""
    mission, states, heard = swarm_mission(4, size=8.0), {}, []
    codec = Codec(mission)

    def channel(key, payload):
        if key.endswith("/word"):
            own = codec.report(codec.word(payload).own)
            if not own.promised:
                states[own.sample, own.agent] = own.position
                heard.append(own)
        return [payload]

    assert fly_swarm(mission, seed=4, channel=channel).complete
    apart = 0
    for report in heard:
        before = report.sample - 1
        for other in range(4):
            if other == report.agent or (before, other) not in states or (before, report.agent) not in states:
                continue
            near = adjacency(np.array([states[before, report.agent], states[before, other]]), 3.5)[0, 1]
            assert near or other not in report.heard
            apart += not near
    assert apart > 20, "they were out of each other's range for a while"


def test_with_keys_nobody_speaks_for_another_and_it_is_counted_and_said(tmp_path):
    names = ("a1", "a2", "a3")
    fleet = make_fleet(tmp_path, agents=names)
    ground = Ground(swarm_mission(), sign=lambda name, transport: SignedTransport(transport, load(fleet, name)))
    agents, words, key = [ground.add(name) for name in names], ground.bus.join(), "cover/swarm/agent/a2/word"
    ears = words.inbox(key, 1000)
    ground.wait(6.0)
    genuine = ears.drain()[-1].payload
    body = verify(load(fleet, "a2").signers["a2"], key, genuine)
    for forged in (body, sign(load(fleet, "a3").signing_key, key, body)):
        words.publisher(key, HISTORYLESS).publish(forged)
    ground.wait(1.0)
    assert agents[0].rejected == {Reason.UNSIGNED: 1, Reason.FORGED: 1}
    assert ground.heard("ignores a word: wrongly signed: must be signed by a2")
    assert all(agent.start_s < ground.clock.now() for agent in agents)


def test_nonsense_is_counted_and_harmless():
    ground = Ground(swarm_mission())
    agents = [ground.add(name) for name in ("a1", "a2", "a3")]
    stranger = ground.bus.join()
    for key in ("hello", "word"):
        for payload in (b"", b"{}", b'{"schema": 99}', b"[" * 5000, b'{"schema": 1, "agent": "a1"}'):
            stranger.publisher(f"cover/swarm/agent/a2/{key}", HISTORYLESS).publish(payload)
    ground.wait(6.0)
    assert all(agent.start_s < ground.clock.now() for agent in agents)
    for payload in (b"", b"{}"):
        stranger.publisher("cover/swarm/agent/a2/word", HISTORYLESS).publish(payload)
    ground.wait(1.0)
    assert sum(agents[0].rejected.values()) >= 2
    assert agents[0].exit_status is None
