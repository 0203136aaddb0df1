"""BLAS on parts of flat arrays, for kernels: column-major matrices with their leading dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.aot.jit import inner
from mlsanm_cli.kernels.blas import dgemm, dgemv, dtrsm, dtrsv

LOWER, RIGHT, PLAIN, TRANSPOSED, UPPER, LEFT, UNIT = 0, 1, 2, 3, 4, 0, 4
"""Positions of the BLAS option letters in :func:`letters`."""


@inner
def letters() -> Any:
    """L, R, N, T, U: lower and left are the same letter, and so are upper and unit."""
    return np.array([76, 82, 78, 84, 85], dtype=np.uint8)


@inner
def solve_triangle(
    kind: tuple[int, int, int, int],
    sizes: tuple[int, int],
    triangle: FloatArray,
    height: int,
    x: FloatArray,
    width: int,
) -> None:
    """Solve in place T x = b or x T = b for x, of ``sizes`` rows and columns; ``kind`` are the options of a
    triangular T: side, part, transposed, diagonal."""
    side, part, trans, diagonal = kind
    c: Any = letters()
    i: Any = np.array([sizes[0], sizes[1], height, width], dtype=np.int32)
    one: Any = np.ones(1)
    dtrsm(
        *(c[side:].ctypes, c[part:].ctypes, c[trans:].ctypes, c[diagonal:].ctypes, i.ctypes, i[1:].ctypes),
        *(one.ctypes, triangle.ctypes, i[2:].ctypes, x.ctypes, i[3:].ctypes),
    )


@inner
def solve_right(
    trans: int, rows: int, columns: int, triangle: FloatArray, height: int, x: FloatArray, width: int
) -> None:
    """Solve x L = b or x L^T = b in place for x (rows, columns), L lower triangular."""
    solve_triangle((RIGHT, LOWER, trans, PLAIN), (rows, columns), triangle, height, x, width)


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
    """product = alpha a b + beta product with a (m, k) and b (k, n) or its transpose; ``sizes`` is m, n,
    k."""
    c: Any = letters()
    i: Any = np.array([sizes[0], sizes[1], sizes[2], lda, ldb, ldc], dtype=np.int32)
    factor: Any = np.array([alpha, beta])
    dgemm(
        *(c[PLAIN:].ctypes, c[trans:].ctypes, i.ctypes, i[1:].ctypes, i[2:].ctypes, factor.ctypes),
        *(a.ctypes, i[3:].ctypes, b.ctypes, i[4:].ctypes, factor[1:].ctypes, product.ctypes, i[5:].ctypes),
    )


@inner
def solve_vector(
    kind: tuple[int, int, int], rows: int, triangle: FloatArray, height: int, x: FloatArray
) -> None:
    """Solve T x = b in place for a triangular T (rows, rows), of ``kind``: part, transposed, diagonal."""
    part, trans, diagonal = kind
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
