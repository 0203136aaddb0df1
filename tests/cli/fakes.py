"""Stand-ins for the functions that the commands call."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

SUMMARY: dict[str, Any] = {
    "status": "done",
    "stop_reason": "target reached",
    "position": 1.0,
    "steps": 243,
    "factorizations": 250,
    "solves": 5000,
    "nodes": 5210,
    "unknowns": 10420,
    "contact_unknowns": 118,
    "seconds": {"total": 2.31, "jit": 0.0, "cloud": 0.25, "operators": 0.5},
    "contacts": {"interface": {"peak_pressure": 1234.5678, "force": [0.0, -350.0], "min_gap": 1.5e-7}},
    "residual": 3.2e-10,
    "force_balance": 1.1e-12,
    "stability": 0.02,
    "peak_memory_mb": 150.0,
    "warnings": [],
    "directory": "results/hertz",
}


MODULES = {"info": "results.info", "plot": "results.plot", "collect": "results.info", "resume": "run"}
"""Modules in ``app`` that are not named like their command."""


def install(monkeypatch: pytest.MonkeyPatch, name: str, function: Callable[..., Any]) -> None:
    """Makes the given function what the command ``name`` calls."""
    module = ModuleType(f"mlsanm_cli.app.{MODULES.get(name, name)}")
    setattr(module, name, function)
    monkeypatch.setitem(sys.modules, module.__name__, module)
