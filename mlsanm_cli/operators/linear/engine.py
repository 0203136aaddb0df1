"""Engines that other packages bring: which are installed, and matrices as they take them."""

from __future__ import annotations

from importlib import metadata

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.operators.linear.interface import Matrix


class MissingEngineError(Exception):
    """An engine's package is not installed; ``extra`` of mlsanm would install it, for which it ``wants``
    something else sometimes."""

    def __init__(self, package: str, extra: str, wants: str = "") -> None:
        super().__init__(f"needs the package {package}, which is not installed")
        self.hint = f"pip install 'mlsanm[{extra}]'" + (f", which wants {wants}" if wants else "")


def installed(package: str, extra: str, wants: str = "") -> metadata.Distribution:
    """The distribution called ``package``; MissingEngineError where there is none."""
    try:
        return metadata.distribution(package)
    except metadata.PackageNotFoundError as error:
        raise MissingEngineError(package, extra, wants) from error


def upper_triangle(matrix: Matrix) -> sparse.coo_array:
    """The upper triangle of a symmetric ``matrix`` (2n, 2n), its diagonal included.

    Taken from its blocks: scipy's would expand both halves first.
    """
    blocks = sparse.bsr_array(matrix, blocksize=(2, 2))
    nodes = np.repeat(np.arange(blocks.shape[0] // 2, dtype=np.int32), np.diff(blocks.indptr))
    upper = blocks.indices >= nodes
    first, second = 2 * nodes[upper], 2 * blocks.indices[upper].astype(np.int32)
    half = np.arange(2, dtype=np.int32)
    rows = np.broadcast_to(first[:, None, None] + half[:, None], (len(first), 2, 2))
    columns = np.broadcast_to(second[:, None, None] + half, (len(first), 2, 2))
    kept = rows <= columns
    entries = (blocks.data[upper][kept], (rows[kept], columns[kept]))
    return sparse.coo_array(entries, shape=blocks.shape)
