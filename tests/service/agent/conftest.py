import pytest

from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.messages import PlanMessage, encode


@pytest.fixture
def agent(bench):
    return bench.agent("a1")


@pytest.fixture
def send(bench, agent):
    publisher = bench.bus.join().publisher(bench.keys.plan(agent.id), bus.PLAN)

    def send(message):
        publisher.publish(encode(message) if isinstance(message, PlanMessage) else message)
        bench.run(seconds=0.1)

    return send
