"""Lazy factorisation of a body's equations: never done if all results are known."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TypeAlias

from mlsanm_cli.operators.system import LinearSystem

Timed: TypeAlias = Callable[[], AbstractContextManager[None]]
"""Context manager factory that measures the time of an operation."""


class BodyEquations:
    """A body's equations, factorised by ``factorise`` on first use. The callable is then dropped with the
    rows it holds. ``content`` is a digest of all input of the equations."""

    def __init__(self, content: str, factorise: Callable[[], LinearSystem]) -> None:
        self.content = content
        self._factorise: Callable[[], LinearSystem] | None = factorise
        self._system: LinearSystem | None = None

    def factorised(self, timed: Timed) -> LinearSystem:
        """The system, factorised once, within ``timed()``. Raises NumericalError if it is singular."""
        if self._system is None:
            assert self._factorise is not None
            with timed():
                self._system = self._factorise()
            self._factorise = None
        return self._system

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; "" if there is none."""
        return "" if self._system is None else self._system.note
