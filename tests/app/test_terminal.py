"""The command in a real pseudo-terminal, and with output that nobody can write or read."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.output import recorder
from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.run import resume
from tests.app.processes import CLI, PATIENCE, mlsanm
from tests.app.runs import resumed_differences
from tests.app.scenes import BAR, Quiet, hertz, solve
from tests.processes import ENVIRONMENT


def in_terminal(columns: int, directory: Path, *arguments: str, **environment: str) -> tuple[int, str, str]:
    """Run ``mlsanm`` with stderr on a terminal and stdout in a pipe: code, stdout, what the terminal got."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    process = subprocess.Popen(
        [sys.executable, *CLI, *arguments],
        cwd=directory,
        env={"TERM": "xterm", **ENVIRONMENT, **environment},
        stdin=slave,
        stdout=subprocess.PIPE,
        stderr=slave,
    )
    os.close(slave)
    shown, end = b"", time.monotonic() + PATIENCE
    while time.monotonic() < end:
        ready, _, _ = select.select([master], [], [], 1.0)
        if not ready:
            continue
        try:
            part = os.read(master, 65536)
        except OSError:
            break
        if not part:
            break
        shown += part
    out, _ = process.communicate(timeout=PATIENCE)
    os.close(master)
    return process.returncode, out.decode(), shown.decode()


def screen(shown: str) -> list[str]:
    """The lines that stay, without styles."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", shown)
    return [line.rpartition("\r\x1b[K")[2] for line in plain.replace("\r\n", "\n").split("\n")]


def test_progress_fits_the_terminal(tmp_path: Path) -> None:
    columns = 30
    # Not symmetric, which would be noted.
    (tmp_path / "case.toml").write_text(hertz().changed("x = [-2.0, 2.0]", "x = [-2.0, 2.1]"))
    code, out, shown = in_terminal(columns, tmp_path, "run", "case.toml", "--out", "run", NO_COLOR="")
    assert code == 0
    assert out.startswith("done: ")
    assert "\x1b" not in out
    assert "\x1b[1mplacing nodes ...\x1b[0m" in shown
    (last, *rest) = [line for line in screen(shown) if line]
    assert re.match(r"step   \d\d   position 1 *$", last)
    assert len(last) < columns
    assert rest == []
    live = re.sub(r"\x1b\[[0-9;]*m", "", shown).replace("\r\n", "\n")
    assert max(len(part) for line in live.split("\n") for part in line.split("\r\x1b[K")) < columns


def test_a_long_path_tells_how_long_it_takes_yet(tmp_path: Path, afterwards: pytest.MonkeyPatch) -> None:
    afterwards.setattr(recorder, "ESTIMATE_AFTER", 0.0)
    console, texts = Quiet(), dict[float, str]()
    afterwards.setattr(
        console, "step", lambda index, position, residual, text: texts.update({position: text})
    )
    solve(BAR, tmp_path / "run", console=console)
    assert re.fullmatch(r"stage 1 of 2 \(pull\), 25 %  \d+ s, \d+ s left", texts[0.5])
    assert re.fullmatch(r"stage 2 of 2 \(squeeze\), 62 %  \d+ s, \d+ s left", texts[1.25])
    assert texts[2.0] == ""


def test_a_log_whose_reader_left_does_not_end_the_run(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(BAR)
    command = [sys.executable, *CLI, "run", "case.toml", "--out", "run"]
    reader, writer = os.pipe()
    os.close(reader)
    with (tmp_path / "out.txt").open("wb") as out:
        done = subprocess.run(command, cwd=tmp_path, env=ENVIRONMENT, stdout=out, stderr=writer, check=False)
    os.close(writer)
    assert done.returncode == 0
    assert info(tmp_path / "run")["status"] == "done"
    assert (tmp_path / "out.txt").read_text().startswith("done: ")


def test_shell_completion(tmp_path: Path) -> None:
    done = mlsanm(tmp_path, _MLSANM_COMPLETE="bash_complete", COMP_WORDS="mlsanm res", COMP_CWORD="1")
    assert done.stdout.split() == ["plain,resume"]
    assert (done.returncode, done.stderr) == (0, "")
    # The line for the shell is printed and nothing else.
    done = mlsanm(tmp_path, _MLSANM_COMPLETE="zsh_source")
    assert (done.returncode, done.stderr) == (0, "")
    assert "mlsanm" in done.stdout


FULL_STREAM = "error: cannot write to stdout: No space left on device"


@pytest.mark.parametrize(
    ("status", "out", "err", "code", "words"),
    [
        ("failed", ">&-", "", 3, ""),
        ("failed", "> /dev/full", "", 3, FULL_STREAM),
        ("failed", "| true", "", 3, ""),
        ("failed", "", "2>&-", 3, ""),
        ("failed", "", "2>/dev/full", 3, ""),
        ("done", "> /dev/full", "", 2, FULL_STREAM),
        ("done", "| true", "", 0, ""),
        ("done", ">&-", "2>&- <&-", 0, ""),
    ],
)
def test_streams_do_not_change_the_exit_code(
    status: str, out: str, err: str, code: int, words: str, tmp_path: Path
) -> None:
    """A failed run stays failed, and one that is done is done, whoever reads what it says."""
    (tmp_path / "run.py").write_text(FAKE)
    command = f"sleep 0.1; {sys.executable} run.py {status} {err} {out}; echo ${{PIPESTATUS[0]}} > code"
    options: dict[str, Any] = {"cwd": tmp_path, "env": ENVIRONMENT, "capture_output": True, "text": True}
    done = subprocess.run(["bash", "-c", command], check=False, **options)
    assert int((tmp_path / "code").read_text()) == code
    assert done.stderr.strip() == words


FAKE = """
import sys, types
app = types.ModuleType("mlsanm_cli.app.run")
app.run = lambda case, **options: {"status": sys.argv[1], "stop_reason": "end", "directory": "run"}
sys.modules["mlsanm_cli.app.run"] = app
from mlsanm_cli.cli import main
sys.exit(main(["run", "case.toml"]))
"""


FULL = """
import resource, signal, sys
from mlsanm_cli.cli import main
from mlsanm_cli.kernels.aot.jit import load
load()
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.exit(main(sys.argv[2:]))
"""


def test_a_full_disk_ends_a_run_that_can_be_resumed(tmp_path: Path) -> None:
    solve(hertz(), tmp_path / "case", "output.vtu=false")
    limit = int(0.8 * (tmp_path / "case" / "run.h5").stat().st_size)
    arguments = ["run", "case.toml", "--out", "run", "--set", "output.vtu=false"]
    done = mlsanm(tmp_path, *arguments, program=("-c", FULL, str(limit)))
    assert done.returncode == 3
    assert "cannot write run/run.h5: File too large" in done.stderr
    assert "hint: make room, then: mlsanm resume run" in done.stderr
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "run").glob("*.tmp"))
    resume(tmp_path / "run", console=Quiet())
    assert resumed_differences(tmp_path / "case", tmp_path / "run") == []
