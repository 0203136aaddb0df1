"""Long searches in pieces, and outside the main thread: signals are handled while they last."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.startup import cKDTree

Result = TypeVar("Result")

BLOCK_SIZE = 8192
"""Points searched for at once: some hundredths of a second."""
POLL_SECONDS = 0.1
"""Interval at which a waiting thread checks for signals, on systems where they do not wake it."""


def nearest(tree: cKDTree, points: FloatArray, k: int | IntArray = 1) -> tuple[FloatArray, IntArray]:
    """Distances and numbers of the nodes of a ``tree`` nearest to ``points`` (n, 2), as its ``query`` gives
    them: (n,) for k = 1, otherwise (n, k)."""
    if len(points) <= BLOCK_SIZE:
        found = tree.query(points, k=k)
        return np.asarray(found[0]), np.asarray(found[1])
    pieces = [tree.query(points[at : at + BLOCK_SIZE], k=k) for at in range(0, len(points), BLOCK_SIZE)]
    return np.concatenate([piece[0] for piece in pieces]), np.concatenate([piece[1] for piece in pieces])


def in_pieces(function: Callable[[AnyArray], AnyArray], rows: AnyArray, piece: int = BLOCK_SIZE) -> AnyArray:
    """``function(rows)``, which treats every row alone, by pieces of so many rows."""
    if len(rows) <= piece:
        return function(rows)
    return np.concatenate([function(rows[at : at + piece]) for at in range(0, len(rows), piece)])


def listening(call: Callable[[], Result]) -> Result:
    """The result of a ``call`` of compiled code that lets other threads run: a thread of its own makes it,
    while this one hears signals. After an interrupt nobody waits for it any more."""
    if threading.current_thread() is not threading.main_thread():
        return call()
    done: list[Result] = []
    failed: list[BaseException] = []

    def work() -> None:
        try:
            done.append(call())
        except BaseException as error:
            failed.append(error)

    thread: Any = threading.Thread(target=work, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(POLL_SECONDS)
    if failed:
        raise failed[0]
    return done[0]
