"""Writes the reference of all keys into case-file.md: run it after changes of the case model."""

from __future__ import annotations

from pathlib import Path

from mlsanm_cli.case.explain import all_explanations, sections

PAGE = Path(__file__).parent / "case-file.md"
MARK = "do not edit below. -->\n"


def page() -> str:
    """The page with an up-to-date reference."""
    text = PAGE.read_text(encoding="utf-8")
    return f"{text[: text.index(MARK)]}{MARK}{sections(all_explanations(), '###')}\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
