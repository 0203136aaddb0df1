"""Settings for all tests."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

# Before numpy is imported: one thread gives the same bits on every machine, and tests run side by side.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# What is written need not outlive a loss of power, and waiting for the disk is a twentieth of all tests.
os.fsync = lambda fd: None

KEPT = 400
"""So many results are kept for other tests."""

settings.register_profile("mlsanm", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("mlsanm")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Runs, comparisons and resumed runs of a process share clouds, operators and condensed scenes, but for
    tests that change the program, as to put faults into it."""
    from mlsanm_cli.memo import NO_CACHE

    changed = not {"monkeypatch", "by_nodes", "alone"}.isdisjoint(getattr(item, "fixturenames", ()))
    NO_CACHE._most = KEPT if item.nodeid.startswith(("tests/app", "tests/cases")) and not changed else 0
