"""Programs with kernels of their own, few and small, in place of the package's, run as processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
KERNELS = """
from __future__ import annotations
import resource, sys
import numpy as np
from mlsanm_cli.kernels.aot import jit, kept, machine
from mlsanm_cli.kernels.blas import dgemm
from mlsanm_cli.kernels.aot.signature import Float1, Float2, FloatOut1, Int1

jit.every_kernel = lambda: list(jit.KERNELS.values())

@jit.inner
def root(x):
    return np.sqrt(x)

@jit.kernel
def roots(x: Float1, scale: float, n: int) -> tuple[Float1, Int1, int, float]:
    y = np.empty(x.size)
    for i in range(x.size):
        y[i] = scale * root(x[i])
    numbers = np.empty(n, dtype=np.int64)
    for i in range(n):
        numbers[i] = i
    return y, numbers, n + 1, scale / 2.0
"""
MORE = """
@jit.kernel
def ones(n: int, m: int) -> Float2:
    return np.ones((n, m))

@jit.kernel
def same(x: Float2) -> Float1:
    return x[1]

@jit.kernel
def filled(x: FloatOut1) -> None:
    x[:] = 7.0

@jit.kernel
def assigned(x: FloatOut1, y: Float1) -> None:
    rows = [np.ones(2)]
    rows.append(y.copy())
    x[:] = rows[1]

@jit.kernel
def square(x: FloatOut1) -> None:
    letters, sizes, one = np.array([78], dtype=np.uint8), np.array([2], dtype=np.int32), np.ones(1)
    c, i, a, whole = letters.ctypes, sizes.ctypes, one.ctypes, x.copy().ctypes
    dgemm(c, c, i, i, i, a, whole, i, whole, i, np.zeros(1).ctypes, x.ctypes, i)
"""
ROOTS = """
print(jit.is_warm())
values, numbers, n, half = roots(np.array([4.0, 9.0]), 0.5, 3)
print(values.tolist(), numbers.tolist(), n, half, "numba" in sys.modules, jit.load().note)
"""


def started(cache: Path, program: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", program],
        env={**os.environ, "PYTHONPATH": str(ROOT), "MLSANM_CACHE_DIR": str(cache), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(cache: Path, program: str, **environment: str) -> list[str]:
    """What the program prints in a fresh process that has the kernels above and keeps them in ``cache``."""
    return run_plain(cache, KERNELS + program, **environment)


def run_plain(cache: Path, program: str, **environment: str) -> list[str]:
    """What a program prints in a fresh process."""
    process = started(cache, program, **environment)
    out, err = process.communicate()
    assert process.returncode == 0, err
    return out.splitlines()


def answer(warm: bool, numba: bool, note: str = "") -> list[str]:
    """What the program ROOTS prints."""
    return [str(warm), f"[1.0, 1.5] [0, 1, 2] 4 0.25 {numba} {note}"]


def files(cache: Path) -> list[Path]:
    return [path for path in (cache / "kernels").rglob("*") if path.is_file()]
