"""Signals end a run in order, at once only when asked twice."""

from __future__ import annotations

import os
import signal

import pytest

from mlsanm_cli.app.signals import STOPPING, Stopper


@pytest.mark.parametrize("number", STOPPING)
def test_the_first_signal_waits_and_the_second_does_not(number: signal.Signals) -> None:
    with Stopper() as stopper:
        stopper.gentle = True
        stopper.check()
        os.kill(os.getpid(), number)
        assert number.name in stopper.reason
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)


def test_an_ungentle_one_is_raised_and_remembered() -> None:
    before = [signal.getsignal(number) for number in STOPPING]
    with Stopper() as stopper:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            stopper.check()
    assert [signal.getsignal(number) for number in STOPPING] == before
