"""Python processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def python(*arguments: str, cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    """A process that has ended, whatever its exit code."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def printed(*arguments: str, cwd: Path = ROOT, **environment: str) -> str:
    """What a process prints that ends well and warns of nothing."""
    done = python("-W", "error", *arguments, cwd=cwd, **environment)
    assert done.returncode == 0, done.stderr
    return done.stdout
