"""Settings for all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

# Before numpy is imported: one thread gives the same bits on every machine, and tests run side by side.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# What is written need not outlive a loss of power, and waiting for the disk is a twentieth of all tests.
os.fsync = lambda fd: None

settings.register_profile("mlsanm", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("mlsanm")


@pytest.fixture(autouse=True)
def _no_memo_of_faults(request: pytest.FixtureRequest) -> Iterator[None]:
    """Tests that change the program, as to put faults into it, share no results with others."""
    if "monkeypatch" not in request.fixturenames:
        yield
        return
    from mlsanm_cli.memo import NO_CACHE
    from tests.app import scenes

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, "SHARED", NO_CACHE)
        yield
