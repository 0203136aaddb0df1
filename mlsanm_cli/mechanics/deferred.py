"""A body's equations, factorised when they are first used: where answers are known already, never."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TypeAlias

from mlsanm_cli.memo import digest
from mlsanm_cli.operators.system import LinearSystem

Timed: TypeAlias = Callable[[], AbstractContextManager[None]]
"""Makes the context in which something that takes time is done."""


class Equations:
    """A body's equations: the ``arrays`` that ``factorise`` makes a system of when it is first asked for.

    Both are let go then: large as they are, the system has all that it needs.
    """

    def __init__(self, arrays: Mapping[str, object], factorise: Callable[[], LinearSystem]) -> None:
        self._arrays: Mapping[str, object] = arrays
        self._factorise: Callable[[], LinearSystem] | None = factorise
        self._system: LinearSystem | None = None

    def factorised(self, timed: Timed) -> LinearSystem:
        """The system, factorised at most once, within ``timed()``; NumericalError where there is none."""
        if self._system is None:
            assert self._factorise is not None
            with timed():
                self._system = self._factorise()
            self.content  # noqa: B018 (the digest of what is let go)
            self._factorise, self._arrays = None, {}
        return self._system

    @property
    def note(self) -> str:
        """What users should know of how the system was factorised, if it was."""
        return "" if self._system is None else self._system.note

    @cached_property
    def content(self) -> str:
        """A digest of all that the system is made of."""
        return digest(self._arrays)
