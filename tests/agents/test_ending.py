"""Ctrl-C and SIGTERM end a program whatever it is doing."""

import signal

import pytest

from agents.ending import ended_by_signals


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_the_middle_of_the_wait_for_it_locks_nothing(number: signal.Signals) -> None:
    with ended_by_signals() as stop:
        with stop._cond:  # pyright: ignore[reportAttributeAccessIssue] # what `wait` holds while it begins and ends
            signal.raise_signal(number)
        assert stop.wait(10.0)


def test_afterwards_signals_do_what_they_did() -> None:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    with ended_by_signals() as stop:
        pass
    assert {number: signal.getsignal(number) for number in before} == before
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert not stop.is_set()
    assert signal.set_wakeup_fd(-1) == -1
