"""Stencils of a mirror-symmetric cloud, built on one side and reflected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import IndexArray
from mlsanm_cli.cloud.mirror import Mirror
from mlsanm_cli.operators.stencil_weights import Stencils


def reflected(stencils: Stencils, mirror: Mirror) -> Stencils:
    """Stencils of all nodes (n) from those of the mirror's own nodes (h).

    Stencils on the line are averaged with their images, as only one of two equidistant nodes may be included.
    """
    times = np.where(mirror.side == 0, 2, 1)
    whole = stencils.take(np.repeat(mirror.place, times))
    first = np.concatenate([[0], np.cumsum(times)])
    imaged = np.repeat(mirror.side < 0, times)
    imaged[first[1:][mirror.side == 0] - 1] = True
    length = np.diff(whole.indptr)
    beyond = np.repeat(imaged, length)
    # In place, kind by kind, to save memory.
    share = np.repeat(np.repeat(1.0 / times, times), length)
    for kind, sign in enumerate(mirror.derivative_signs(whole.weights.shape[1])):
        whole.weights[:, kind] *= np.where(beyond, sign, 1.0) * share
    indices = np.where(beyond, mirror.image[whole.indices], whole.indices)
    return replace(whole, indptr=whole.indptr[first], indices=indices)


def reflected_numbers(numbers: IndexArray, mirror: Mirror) -> IndexArray:
    """Node numbers (n, k) for all nodes from those (h, k) of the mirror's own nodes."""
    whole, beyond = numbers[mirror.place], mirror.side < 0
    whole[beyond] = mirror.image[whole[beyond]]
    return whole
