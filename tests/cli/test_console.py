"""Progress on a terminal and in a log."""

from __future__ import annotations

import io
import os
import signal
import sys
import time
from types import ModuleType

import pytest

from mlsanm_cli.cli.console import Settings, TerminalConsole
from mlsanm_cli.stopping import Stopper


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True

    def screen(self) -> list[str]:
        """What is left to see: carriage returns and erasures applied."""
        lines = [""]
        for part in self.getvalue().replace("\r\x1b[K", "\0").split("\n"):
            lines[-1] = part.rpartition("\0")[2]
            lines.append("")
        return lines[:-1]


class Clock:
    """Time that continues by a given step at every look."""

    def __init__(self, step: float) -> None:
        self.now, self.step = 0.0, step

    def __call__(self) -> float:
        self.now += self.step
        return self.now


@pytest.fixture(autouse=True)
def _plain_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)


def play(console: TerminalConsole, steps: int = 25) -> None:
    console.phase("clouds")
    console.phase("path")
    for index in range(1, steps + 1):
        console.step(index, index / steps, 1e-9, "pade")
    console.note("saved")
    console.close()


def test_a_log_gets_the_first_the_last_and_one_step_per_second() -> None:
    stream = io.StringIO()
    play(TerminalConsole(stream, Settings(), clock=Clock(0.125)), steps=27)
    lines = stream.getvalue().splitlines()
    assert [line.split()[0] for line in lines] == ["clouds", "path", *["step"] * (len(lines) - 3), "saved"]
    assert [int(line.split()[1]) for line in lines[2:-1]] == [1, 9, 17, 25, 27]
    assert "position 0.037037" in lines[2]
    assert "residual 1.00e-09" in lines[2]
    assert "\r" not in stream.getvalue()
    assert "\x1b" not in stream.getvalue()


def test_a_terminal_keeps_steps_and_messages_and_no_phase() -> None:
    stream = Terminal()
    play(TerminalConsole(stream, Settings(color="never"), clock=Clock(0.01), width=120))
    last, note, rest = stream.screen()
    assert (int(last.split()[1]), note, rest) == (25, "saved", "")
    console = TerminalConsole(stream, Settings(color="never"), clock=Clock(1.0), width=120)
    console.step(1, 0.5, 1e-9)
    console.phase("fields")
    console.note("100 nodes")
    # What is done goes on below a message.
    assert stream.screen()[-2:] == ["100 nodes", "fields ..."]
    console.close()
    assert stream.screen()[-1] == ""


REMARK = "closed 165  peak pressure 2532.11"


def test_a_warning_between_steps_stands_on_its_own_line() -> None:
    stream = Terminal()
    console = TerminalConsole(stream, Settings(color="never"), clock=Clock(1.0), width=120)
    console.phase("path")
    console.step(1, 0.5, 1e-9)
    console.warning("gap closed")
    assert stream.screen()[-1] == "solving ..."
    console.step(2, 1.0, 1e-9)
    console.close()
    assert [line.split()[0] for line in stream.screen() if line] == ["step", "warning:", "step"]


def test_a_dumb_terminal_is_a_log(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    stream = Terminal()
    play(TerminalConsole(stream, Settings(), clock=Clock(0.1)))
    assert "\x1b" not in stream.getvalue()


def test_a_line_that_stands_still_tells_since_when(monkeypatch: pytest.MonkeyPatch) -> None:
    # The modules of a command are being imported: their names exist, what they define does not.
    monkeypatch.setitem(sys.modules, "mlsanm_cli.app.context", ModuleType("mlsanm_cli.app.context"))
    stream = Terminal()
    console = TerminalConsole(stream, Settings(color="never"), clock=Clock(1.0), width=80, interval=0.02)
    for what in ("phase", "step"):
        if what == "phase":
            console.phase("factorising")
        else:
            console.step(3, 0.5, 1e-9)
        end = time.monotonic() + 5.0
        while not stream.getvalue().endswith(" s") and time.monotonic() < end:
            time.sleep(0.01)
        assert stream.getvalue().endswith(" s")
    assert "\r\x1b[Kfactorising ...  0 s" in stream.getvalue()
    console.close()
    ended = stream.getvalue()
    time.sleep(0.1)
    assert stream.getvalue() == ended
    # What stays is the step as it was.
    assert stream.screen()[0].split()[:4] == ["step", "3", "position", "0.5"]
    assert stream.screen()[1:] == [""]


def test_a_signal_that_is_obeyed_later_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    console = TerminalConsole(stream, Settings(color="never"), clock=Clock(1.0), width=80)
    console.step(67, 0.876543, 5.14e-16, REMARK)
    with Stopper() as stopper:
        stopper.gentle = True
        os.kill(os.getpid(), signal.SIGINT)
        console._show_elapsed(3.0)
        assert stream.screen()[-1] == "stopping after this step; Ctrl-C again stops at once  3 s"
    console._show_elapsed(4.0)
    assert stream.screen()[-1].startswith("step   67")
