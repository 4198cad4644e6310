import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from llrp_online.pace import Pace

S = 10**9


def lived(pace, times_ns, *, learning=True):
    """How many steps are taken while the clock shows these times."""
    taken = 0
    for t_ns in times_ns:
        pace.advance(t_ns, learning=learning)
        while pace.due():
            pace.taken()
            taken += 1
    return taken


@given(st.lists(st.integers(1, S), min_size=1, max_size=200), st.floats(0.1, 50.0), st.integers(-(10**12), 10**18))
def test_steps_follow_the_time_however_it_is_split(splits_ns, rate, start_ns):
    times = [start_ns]
    for split_ns in splits_ns:
        times.append(times[-1] + split_ns)
    pace = Pace(rate)
    steps, seconds = lived(pace, times), sum(splits_ns) / S
    assert pace.lived_s == pytest.approx(seconds)
    # Never ahead of the clock, and never a whole step behind it; but for rounding.
    assert seconds * rate - 1 - 1e-5 <= steps <= seconds * rate + 1e-5
    assert pace.let_go == 0


@given(st.lists(st.tuples(st.integers(1, S), st.integers(0, 5 * S)), min_size=1, max_size=50))
def test_late_messages_change_nothing(arrivals):
    rate = 3.0
    pace, punctual, now, steps, expected = Pace(rate), Pace(rate), 0, lived(Pace(rate), [0]), 0
    pace.advance(0, learning=True)
    punctual.advance(0, learning=True)
    for passed_ns, late_ns in arrivals:
        now += passed_ns
        steps += lived(pace, [now, now - late_ns, now])
        expected += lived(punctual, [now])
    assert steps == expected
    assert pace.lived_s == punctual.lived_s


def test_a_clock_set_far_back_is_another_clock():
    pace = Pace(2.0)
    assert lived(pace, [100 * S, 101 * S]) == 2
    assert lived(pace, [0, S]) == 2  # the jump itself counts nothing
    assert pace.lived_s == 2.0


def test_a_long_silence_is_no_life():
    pace = Pace(2.0)
    assert lived(pace, [0, 1000 * S]) == 2
    assert pace.lived_s == 1.0


def test_after_a_recording_any_clock_may_come():
    pace = Pace(2.0)
    lived(pace, [0, S])
    pace.end_recording()
    assert lived(pace, [int(1.5 * S)]) == 0
    assert lived(pace, [2 * S]) == 1
    assert pace.lived_s == 1.5


@given(st.floats(0.01, 20.0), st.integers(1, 100))
def test_a_learner_that_is_too_slow_lets_go_of_old_steps(rate, seconds):
    pace = Pace(rate)
    for t_s in range(seconds + 1):
        pace.advance(t_s * S, learning=True)
    owed = 0
    while pace.due():
        pace.taken()
        owed += 1
    assert owed <= max(5 * rate, 1) + 1e-5
    assert pace.let_go >= 0
    # What was owed was either taken, let go, or is the rest of less than one step.
    assert seconds * rate - 1 - 1e-5 <= owed + pace.let_go <= seconds * rate + 1e-5


def test_while_not_learning_nothing_falls_due_but_time_passes():
    pace = Pace(10.0)
    assert lived(pace, [0, S, 2 * S], learning=False) == 0
    assert pace.lived_s == 2.0
    assert lived(pace, [int(2.5 * S)]) == 5


@given(st.lists(st.integers(1, S), min_size=2, max_size=60), st.data())
def test_restored_it_goes_on_as_if_nothing_had_been(splits_ns, data):
    times = [5 * S]
    for split_ns in splits_ns:
        times.append(times[-1] + split_ns)
    cut = data.draw(st.integers(0, len(times)))
    whole, first, second = Pace(3.0), Pace(3.0), Pace(3.0)
    steps = lived(whole, times)
    before = lived(first, times[:cut])
    second.restore(json.loads(json.dumps(first.state())))
    assert before + lived(second, times[cut:]) == steps
    assert second.state() == whole.state()
