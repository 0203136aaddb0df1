"""Scenes at finite strain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.app.scenes import solve
from tests.case_text import head, material


def rubber(modulus: float, poisson: float) -> str:
    """Head of a case in plane strain, with one material."""
    return head("strain", strain="finite") + neo_hookean("rubber", modulus, poisson)


def neo_hookean(name: str, modulus: float, poisson: float) -> str:
    return material(name, E=modulus, nu=poisson, law="neo-hookean")


def done(text: str, directory: Path, *overrides: str) -> Mapping[str, Any]:
    """The summary of a run, which reaches its end."""
    summary = solve(text, directory, *overrides)
    assert summary["status"] == "done", summary["stop_reason"]
    return summary
