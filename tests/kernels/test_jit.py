"""Kernels run with and without a place to keep their machine code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import numpy as np
from mlsanm_cli.kernels import jit
from mlsanm_cli.kernels.fill import spacing_at
h = spacing_at(1.0, np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.1, 0.2]]), np.array([[0.6, 0.0]]))
print(f"{h[0]:.6f}|{jit.is_warm()}|{jit.CACHE_NOTE}")
"""


def run(cache: Path) -> list[str]:
    """The program's answer in a fresh process that keeps its kernels in ``cache``."""
    environment = {**os.environ, "MLSANM_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip().split("|")


def test_where_nothing_can_be_written_kernels_run_uncached_and_say_so(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    value, warm, note = run(blocked / "below")
    assert value == "0.600000"
    assert warm == "False"
    assert "MLSANM_CACHE_DIR" in note


def test_machine_code_is_kept_by_source(tmp_path: Path) -> None:
    assert run(tmp_path) == ["0.600000", "True", ""]
    assert len(list((tmp_path / "kernels").iterdir())) == 1
    assert list(tmp_path.rglob("*.nbc"))
