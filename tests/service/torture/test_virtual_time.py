"""Virtual time: events in their order, threads one at a time."""

from mpc_cover.service.torture.virtual_time import Turn, VirtualTime


def test_events_happen_in_the_order_of_their_times_and_those_of_one_time_as_they_were_planned():
    time, seen = VirtualTime(), []
    for name, at_s in (("c", 2.0), ("a", 1.0), ("b", 1.0)):
        time.at(at_s, lambda name=name: seen.append((name, time.now_s)))
    time.run(10.0, lambda: False)
    assert seen == [("a", 1.0), ("b", 1.0), ("c", 2.0)]


def test_what_is_planned_for_the_past_happens_now_and_time_never_runs_backwards():
    time, seen = VirtualTime(), []
    time.at(3.0, lambda: time.at(1.0, lambda: seen.append(time.now_s)))
    time.run(10.0, lambda: False)
    assert seen == [3.0]


def test_it_ends_at_its_limit_and_as_soon_as_it_is_over():
    time, seen = VirtualTime(), []
    for at_s in (1.0, 2.0, 3.0, 4.0):
        time.at(at_s, lambda at_s=at_s: seen.append(at_s))
    time.run(3.0, lambda: seen == [1.0, 2.0])
    assert seen == [1.0, 2.0]
    time.run(3.0, lambda: False)
    assert seen == [1.0, 2.0, 3.0]


def test_a_function_runs_only_while_it_has_the_turn():
    seen: list[str] = []

    def body() -> None:
        seen.append("begins")
        turn.wait()
        seen.append("goes on")

    turn = Turn(body)
    assert seen == []
    turn.give()
    assert seen == ["begins"]
    assert not turn.over
    turn.give()
    assert seen == ["begins", "goes on"]
    assert turn.over
    turn.give()  # nothing is left to do
