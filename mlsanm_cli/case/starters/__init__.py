"""Starter cases: a small, commented case for each kind of scene, written by ``mlsanm new``. The published
cases, with finer clouds and closed formulas, are in ``cases``."""

from __future__ import annotations

import tomllib
from importlib import resources


def kinds() -> dict[str, str]:
    """Titles of the starters by kind, in alphabetical order."""
    files = sorted(entry.name for entry in resources.files(__name__).iterdir())
    names = [name.removesuffix(".toml") for name in files if name.endswith(".toml")]
    return {name: tomllib.loads(starter(name))["title"] for name in names}


def starter(kind: str) -> str:
    return resources.files(__name__).joinpath(f"{kind}.toml").read_text(encoding="utf-8")
