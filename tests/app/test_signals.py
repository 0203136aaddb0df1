"""Signals end a run in order, at once only when asked twice."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from mlsanm_cli.app.context import Stopper
from mlsanm_cli.app.sweep.point import SweepPoint, solve_point
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.system import STOPPING
from tests.app.scenes import hertz

PATIENCE = 60.0


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


def test_a_process_of_a_pool_ends_at_once(tmp_path: Path) -> None:
    """Its pool terminates it and waits: an orderly end would leave it waiting for points for good."""
    positions = ", ".join(str(0.2 + 0.0002 * k) for k in range(4001))
    case, run = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(
        hertz().replace("accuracy = 0.01", "accuracy = 0.1")
        + f"\n[output]\nvtu = false\nat = [{positions}]\n"
    )
    point = SweepPoint(case, (), run, "run", threads=1, memory=1, argv=(), done=False)
    process = multiprocessing.get_context("spawn").Process(target=solve_point, args=(point,))
    process.start()
    deadline = time.monotonic() + PATIENCE
    log = run / "events.jsonl"
    while not log.is_file() or log.read_text().count('"step"') < 3:
        assert process.is_alive()
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.terminate()
    process.join(PATIENCE)
    assert process.exitcode == -signal.SIGTERM
    # What was done since run.h5 was last written is lost; the file is whole.
    read_run(run)
