"""The commit that this code is from: of the source tree, or what was built into the installed package."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

FILE = "commit.txt"
"""In the package of a wheel or a source distribution; setup.py writes it."""


@lru_cache(maxsize=1)
def commit() -> str:
    """The commit, "+" behind it if files differ from it; "" where it is unknown."""
    package = Path(__file__).resolve().parent
    found = git_state(package.parent)
    if found:
        return found
    try:
        return (package / FILE).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def git_state(directory: Path) -> str:
    """Commit of a source tree, "+" behind it if files differ; "" where there is no git."""
    if not (directory / ".git").exists():
        return ""
    import subprocess  # which installed packages do without

    try:
        output = subprocess.run(
            ["git", "-C", str(directory), "describe", "--always", "--dirty=+", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return output.stdout.strip()
