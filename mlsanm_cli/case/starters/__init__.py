"""Starter cases: a small, commented case for each kind of scene, written by ``mlsanm new``. The published
cases, with finer clouds and closed formulas, are in ``cases``."""

from __future__ import annotations

import tomllib
from importlib import resources

SUFFIX = ".toml"


def kinds() -> dict[str, str]:
    """Titles of the starters by kind, in alphabetical order."""
    names = sorted(entry.name for entry in resources.files(__name__).iterdir() if entry.name.endswith(SUFFIX))
    return {name.removesuffix(SUFFIX): tomllib.loads(_read(name))["title"] for name in names}


def starter(kind: str) -> str:
    return _read(f"{kind}{SUFFIX}")


def _read(name: str) -> str:
    return resources.files(__name__).joinpath(name).read_text(encoding="utf-8")
