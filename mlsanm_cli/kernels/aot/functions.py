"""Functions that are compiled: kernels, and those that only kernels call."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from mlsanm_cli.kernels.aot.signature import Signature


class Inner:
    """A function that kernels may call."""

    __wrapped__: Callable[..., Any]

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.__wrapped__(*arguments)


class Kernel(Inner):
    """A function that is called as machine code, which ``loaded`` gives at the first call."""

    def __init__(self, function: Callable[..., Any], loaded: Callable[[Kernel], Callable[..., Any]]) -> None:
        super().__init__(function)
        self.name = f"{function.__module__}.{function.__name__}"
        self.signature = Signature.of(self.name, function)
        self._loaded = loaded
        self._call: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        if self._call is None:
            self._call = self._loaded(self)
        return self._call(*arguments)
