"""The loaded machine code gives what numba itself gives, kernel by kernel, for what a real scene asks."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import build_cloud
from mlsanm_cli.cloud.curves import sector
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.kernels.compiler import in_process
from mlsanm_cli.kernels.jit import every_kernel, load
from mlsanm_cli.kernels.machine import Machine
from tests.app.scenes import hertz, solve

CALLS = 3


def bits(value: Any) -> Any:
    """Something that is equal for equal types, shapes and bits only."""
    if isinstance(value, tuple):
        return tuple(bits(part) for part in value)
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    return type(value).__name__, np.asarray(value).tobytes()


def recording(call: Callable[..., Any], calls: list[tuple[Any, ...]]) -> Callable[..., Any]:
    """``call`` that puts copies of its first arguments on the list."""

    def recorded(*arguments: Any) -> Any:
        if len(calls) < CALLS:
            calls.append(copy.deepcopy(arguments))
        return call(*arguments)

    return recorded


def test_kept_code_and_numba_agree_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = load().machine
    assert isinstance(machine, Machine)
    calls: dict[str, list[tuple[Any, ...]]] = {kernel.name: [] for kernel in every_kernel()}
    monkeypatch.setenv("MLSANM_CACHE_LIMIT_MB", "0")
    for kernel in every_kernel():
        call = machine.function(kernel.name, kernel.signature)
        monkeypatch.setattr(kernel, "_call", recording(call, calls[kernel.name]))
    solve(hertz(), tmp_path / "run")
    slit = build_cloud(sector((0.0, 0.0), (0.3, 1.0), (0.0, 6.27)), Spacing(0.1), 0)
    assert slit.sight is not None
    slit.sight.cut(slit.points, np.arange(len(slit.points))[None].repeat(len(slit.points), axis=0))
    for kernel in every_kernel():
        assert calls[kernel.name], f"{kernel.name} is not called by the scene"
        loaded, jitted = machine.function(kernel.name, kernel.signature), in_process(kernel)
        for arguments in calls[kernel.name]:
            one, other = copy.deepcopy(arguments), copy.deepcopy(arguments)
            assert bits((loaded(*one), one)) == bits((jitted(*other), other)), kernel.name
            for value, before, told in zip(one, arguments, kernel.signature.arguments, strict=True):
                assert told.written or bits(value) == bits(before)
