"""Copies by loops, and BLAS on parts of flat arrays, for kernels: column-major matrices with their leading
dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import AnyArray, FloatArray
from mlsanm_cli.kernels.aot.jit import inner
from mlsanm_cli.kernels.blas import dgemm, dgemv, dtrsm, dtrsv

LOWER, RIGHT, PLAIN, TRANSPOSED, UPPER, LEFT, UNIT = 0, 1, 2, 3, 4, 0, 4
"""Positions of the BLAS option letters in :func:`letters`. They are passed one by one: numba compiles a
function again for every tuple of constants."""


@inner
def copy_to(target: AnyArray, source: AnyArray) -> None:
    """Write ``source`` (n,) to the beginning of ``target``. For slice assignment numba would compile the
    message of a shape mismatch, some seconds per number of dimensions."""
    for i in range(len(source)):
        target[i] = source[i]


@inner
def letters() -> Any:
    """L, R, N, T, U: lower and left are the same letter, and so are upper and unit."""
    return np.array([76, 82, 78, 84, 85], dtype=np.uint8)


@inner
def solve_triangle(
    side: int,
    part: int,
    trans: int,
    diagonal: int,
    rows: int,
    columns: int,
    triangle: FloatArray,
    height: int,
    x: FloatArray,
    width: int,
) -> None:
    """Solve T x = b or x T = b in place for x (rows, columns) and a triangular T."""
    c: Any = letters()
    i: Any = np.array([rows, columns, height, width], dtype=np.int32)
    one: Any = np.ones(1)
    dtrsm(
        *(c[side:].ctypes, c[part:].ctypes, c[trans:].ctypes, c[diagonal:].ctypes, i.ctypes, i[1:].ctypes),
        *(one.ctypes, triangle.ctypes, i[2:].ctypes, x.ctypes, i[3:].ctypes),
    )


@inner
def multiply(
    trans: int,
    sizes: tuple[int, int, int],
    alpha: float,
    a: FloatArray,
    lda: int,
    b: FloatArray,
    ldb: int,
    beta: float,
    product: FloatArray,
    ldc: int,
) -> None:
    """product = alpha a b + beta product, a (m, k), b (k, n) or transposed; ``sizes`` m, n, k."""
    c: Any = letters()
    i: Any = np.array([sizes[0], sizes[1], sizes[2], lda, ldb, ldc], dtype=np.int32)
    factor: Any = np.array([alpha, beta])
    dgemm(
        *(c[PLAIN:].ctypes, c[trans:].ctypes, i.ctypes, i[1:].ctypes, i[2:].ctypes, factor.ctypes),
        *(a.ctypes, i[3:].ctypes, b.ctypes, i[4:].ctypes, factor[1:].ctypes, product.ctypes, i[5:].ctypes),
    )


@inner
def solve_vector(
    part: int, trans: int, diagonal: int, rows: int, triangle: FloatArray, height: int, x: FloatArray
) -> None:
    """Solve T x = b in place for a triangular T (rows, rows)."""
    c: Any = letters()
    i: Any = np.array([rows, height, 1], dtype=np.int32)
    dtrsv(
        *(c[part:].ctypes, c[trans:].ctypes, c[diagonal:].ctypes, i.ctypes, triangle.ctypes, i[1:].ctypes),
        *(x.ctypes, i[2:].ctypes),
    )


@inner
def apply(trans: int, sizes: tuple[int, int], a: FloatArray, lda: int, x: FloatArray, y: FloatArray) -> None:
    """Compute y -= a x or y -= a^T x with ``sizes`` the rows and columns of a."""
    c: Any = letters()
    i: Any = np.array([sizes[0], sizes[1], lda, 1], dtype=np.int32)
    factor: Any = np.array([-1.0, 1.0])
    dgemv(
        *(c[trans:].ctypes, i.ctypes, i[1:].ctypes, factor.ctypes, a.ctypes, i[2:].ctypes),
        *(x.ctypes, i[3:].ctypes, factor[1:].ctypes, y.ctypes, i[3:].ctypes),
    )
