"""What a controller shows of itself: a status now and then, and the map."""

from itertools import pairwise

import numpy as np

from mpc_cover.service.protocol.decoding import decode_map, decode_status
from mpc_cover.service.protocol.messages import Phase


def test_the_map_is_published_and_can_be_asked_for(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
    answer = bench.bus.join().post(bench.keys.map, b"")
    bench.run(controller, until=lambda: controller.done)
    asked = decode_map(answer[0][1])
    last = decode_map(bench.hear(bench.keys.map).drain()[-1].payload)
    assert asked.covered_count <= last.covered_count <= 48
    bits = np.unpackbits(np.frombuffer(bytes.fromhex(asked.bits), dtype=np.uint8))[: asked.cell_count]
    assert bits.sum() == asked.covered_count


def test_the_heartbeat_is_at_most_twice_a_second_and_only_out_of_ticks(bench, fleet, law):
    inbox = bench.hear(bench.keys.status)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    seen = inbox.drain()
    statuses = [decode_status(item.payload) for item in seen]
    assert [status.seq for status in statuses] == list(range(len(seen)))
    beats = [(item.received_s, status.phase) for item, status in zip(seen, statuses, strict=True)]
    for (before, former), (now, phase) in pairwise(beats):
        assert now - before > 0.5 - 1e-6 or former is not phase
    assert statuses[-1].phase is Phase.COMPLETE
    assert statuses[-1].covered_count == 48
