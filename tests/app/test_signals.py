"""Signals end a run in order, at once only when asked twice."""

from __future__ import annotations

import os
import signal
import threading
import time

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


def test_the_wall_time_comes_as_a_signal() -> None:
    with Stopper(max_wall=0.05) as stopper:
        stopper.gentle = True
        stopper.check()
        time.sleep(0.1)
        assert "wall time" in stopper.reason
        with pytest.raises(KeyboardInterrupt, match=r"wall time of 0\.05 s is over"):
            stopper.check()
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    with Stopper(max_wall=0.05), pytest.raises(KeyboardInterrupt, match="wall time"):
        time.sleep(1.0)


def test_the_wall_time_holds_in_a_thread() -> None:
    found = []

    def wait() -> None:
        with Stopper(max_wall=0.05) as stopper:
            stopper.check()
            time.sleep(0.1)
            try:
                stopper.check()
            except KeyboardInterrupt as stop:
                found.append(str(stop))

    thread = threading.Thread(target=wait)
    thread.start()
    thread.join()
    assert found == ["the wall time of 0.05 s is over"]
