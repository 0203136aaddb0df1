"""Copies by loops: an array assigned to a slice has numba compile the message of a shape that does not fit,
which takes some seconds for every dimension. Loops from zero over slices become copies of whole vectors."""

from __future__ import annotations

from mlsanm_cli.arrays import AnyArray
from mlsanm_cli.kernels.aot.jit import inner


@inner
def copy_to(target: AnyArray, source: AnyArray) -> None:
    """Write ``source`` (n,) to the beginning of ``target``."""
    for i in range(len(source)):
        target[i] = source[i]
