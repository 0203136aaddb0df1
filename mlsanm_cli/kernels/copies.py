"""Array copies by loops: for slice assignment numba compiles the message of a shape mismatch, some seconds
per number of dimensions. Loops from zero over slices are vectorised."""

from __future__ import annotations

from mlsanm_cli.arrays import AnyArray
from mlsanm_cli.kernels.aot.jit import inner


@inner
def copy_to(target: AnyArray, source: AnyArray) -> None:
    """Write ``source`` (n,) to the beginning of ``target``."""
    for i in range(len(source)):
        target[i] = source[i]
