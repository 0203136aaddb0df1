"""Settings for all tests."""

from __future__ import annotations

import os

from hypothesis import settings

# Before numpy is imported: one thread gives the same bits on every machine, and tests run side by side.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# What is written need not outlive a loss of power, and waiting for the disk is a twentieth of all tests.
os.fsync = lambda fd: None

settings.register_profile("mlsanm", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("mlsanm")
