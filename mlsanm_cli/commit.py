"""The commit of this code: of the source tree, or as stored in the installed package."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

FILE = "commit.txt"
"""Written by setup.py into the package of a wheel or a source distribution."""


@lru_cache(maxsize=1)
def commit() -> str:
    """The commit, followed by "+" if files differ from it; "" if unknown."""
    package = Path(__file__).resolve().parent
    found = git_state(package.parent)
    if found:
        return found
    try:
        return (package / FILE).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def git_state(directory: Path) -> str:
    """The commit of a source tree, followed by "+" if files differ; "" without git."""
    if not (directory / ".git").exists():
        return ""
    import subprocess

    # Unlike `git describe` this does not search the history for tags.
    command = ["git", "-C", str(directory), "status", "--porcelain=v2", "--branch", "--untracked-files=no"]
    try:
        output = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
    lines = output.splitlines()
    (head,) = (line.split()[2] for line in lines if line.startswith("# branch.oid"))
    changed = any(not line.startswith("#") for line in lines)
    return "" if head == "(initial)" else head[:12] + "+" * changed
