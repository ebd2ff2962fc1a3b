"""Commands to a controller: each is obeyed once, and what is no command is refused in words."""

from mpc_cover.service.protocol.decoding import decode_reply
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode


def test_pause_resume_and_a_repeated_request(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.states) > 2)
    asker = bench.bus.join()
    pause, again = (asker.post(bench.keys.command("pause"), encode(CommandRequest(request="r1"))) for _ in range(2))
    bench.run(controller, seconds=0.6)
    assert [decode_reply(answer[1]).accepted for answer in (*pause, *again)] == [True, True]
    bench.run(controller, seconds=10.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "paused"
    asker.post(bench.keys.command("resume"), encode(CommandRequest(request="r2")))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0


def test_abort_and_what_is_no_command(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING)
    asker = bench.bus.join()
    wrong = asker.post(bench.keys.command("explode"), encode(CommandRequest(request="r1")))
    junk = asker.post(bench.keys.command("abort"), b"junk")
    bench.run(controller, seconds=0.6)
    assert [answered for answered, _ in (*wrong, *junk)] == [False, False]
    assert b"must be one of pause, resume, abort" in wrong[0][1]
    asker.post(bench.keys.command("abort"), encode(CommandRequest(request="r2")))
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 1
    assert all(agent.at_rest for agent in fleet)
