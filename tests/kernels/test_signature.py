"""What kernels accept: the very types they were compiled for, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mlsanm_cli.kernels.fill import spacing_at
from mlsanm_cli.kernels.stencils import mls_weights

ZONES = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.1, 0.2]])
POINTS = np.array([[0.6, 0.0], [0.0, 0.0], [9.0, 0.0]])
SPACINGS = [0.6, 0.5, 1.0]


@pytest.mark.parametrize(
    ("points", "told"),
    [
        (POINTS.astype(np.float32), "float32 of 2 dimensions"),
        (POINTS.astype(np.int64), "int64"),
        (POINTS.astype(">f8"), ">f8"),
        (POINTS[:, 0].copy(), "of 1 dimensions"),
        (POINTS[::2], "not C-contiguous"),
        (np.asfortranarray(POINTS), "not C-contiguous"),
        (np.frombuffer(b"." + POINTS.tobytes(), np.uint8)[1:].view(np.float64).reshape(-1, 2), "float64"),
        (POINTS.tolist(), "not list"),
        (None, "not NoneType"),
    ],
)
def test_other_arrays_are_refused(points: Any, told: str) -> None:
    with pytest.raises(
        TypeError, match=r"spacing_at: points must be a C-contiguous float64 array of 2"
    ) as got:
        spacing_at(1.0, ZONES, points)
    assert told in str(got.value)


def weights(degree: Any, out: Any, points: Any = POINTS) -> None:
    """Weights of value and slopes at the first of three points."""
    at, stencil = POINTS[:1].copy(), (np.array([0, 3]), np.arange(3))
    mls_weights(points, *stencil, at, at, np.array([10.0]), degree, 4.0, 0, 1, out, np.empty(1))


def test_integers_must_be_such_and_fit() -> None:
    for degree in (1, np.int32(1), np.uint64(1)):
        weights(degree, np.empty((3, 3)))
    with pytest.raises(TypeError, match="float"):
        weights(1.0, np.empty((3, 3)))
    for degree in (2**63, -(2**63) - 1):
        with pytest.raises(OverflowError):
            weights(degree, np.empty((3, 3)))


def test_read_only_arrays_are_read_and_not_written_to() -> None:
    points, out = POINTS.copy(), np.empty((3, 3))
    for array in (points, out):
        array.flags.writeable = False
    assert np.allclose(spacing_at(1.0, ZONES, points), SPACINGS, rtol=1e-15)
    with pytest.raises(TypeError, match=r"weights must be a C-contiguous, writable.*read-only"):
        weights(1, out, points)


def test_the_number_of_arguments_is_checked() -> None:
    for arguments in ((), (1.0, ZONES), (1.0, ZONES, POINTS, POINTS)):
        with pytest.raises(TypeError, match=f"spacing_at takes 3 arguments, not {len(arguments)}"):
            spacing_at(*arguments)
