"""``mlsanm warmup``: compiles the kernels before the first run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mlsanm_cli.app.context import Clock, Console, RunContext
from mlsanm_cli.app.scene.build import load_kernels
from mlsanm_cli.kernels.aot.jit import is_warm


def warmup(console: Console) -> Mapping[str, Any]:
    """Compiles the kernels, or loads them if they are compiled. Returns CPU ``seconds``, whether they were
    ``compiled`` now, whether the code is ``kept`` for later runs, and the ``cache_directory`` (None if it is
    not kept)."""
    clock = Clock()
    with clock.phase("jit"):
        warm = is_warm()
    place = load_kernels(RunContext(clock, console)).place
    return {
        "seconds": clock.seconds["jit"],
        "compiled": not warm,
        "kept": place is not None,
        "cache_directory": None if place is None else str(place),
    }
