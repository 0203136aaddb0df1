"""Writes the table of all checks into troubleshooting.md: run it after changes of their limits."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mlsanm_cli.app.checks.check import ANY, LIMITS, Limit

PAGE = Path(__file__).parent / "troubleshooting.md"
MARKS = (
    "<!-- Generated from app/checks/check.py by docs/update_checks.py. -->\n",
    "<!-- End of checks. -->\n",
)


def page() -> str:
    """The page with an up-to-date table."""
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.partition(MARKS[0])[0], text.partition(MARKS[1])[2]
    return f"{before}{MARKS[0]}\n{''.join(table())}\n{MARKS[1]}{after}"


def table() -> Iterator[str]:
    """Lines of the table."""
    yield "| check | warns | fails | value |\n|---|---|---|---|\n"
    for name, limit in LIMITS.items():
        levels = " | ".join(_level(limit, level) for level in (limit.warns, limit.fails))
        yield f"| `{name}` | {levels} | {limit.meaning} |\n"


def _level(limit: Limit, level: float | None) -> str:
    """A level in words."""
    if level is None:
        return ""
    return f"below {level:g}" if limit.lower else f"above {level:g}" if level != ANY else "any"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
