"""A body's equations, factorised when they are first used: where answers are known already, never."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TypeAlias

from mlsanm_cli.operators.system import LinearSystem

Timed: TypeAlias = Callable[[], AbstractContextManager[None]]
"""Makes the context in which something that takes time is done."""


class BodyEquations:
    """A body's equations: what ``factorise`` makes a system of when it is first asked for.

    It is let go then: large as its rows are, the system has all that it needs. ``content`` is a digest of all
    that the equations follow from.
    """

    def __init__(self, content: str, factorise: Callable[[], LinearSystem]) -> None:
        self.content = content
        self._factorise: Callable[[], LinearSystem] | None = factorise
        self._system: LinearSystem | None = None

    def factorised(self, timed: Timed) -> LinearSystem:
        """The system, factorised at most once, within ``timed()``; NumericalError where there is none."""
        if self._system is None:
            assert self._factorise is not None
            with timed():
                self._system = self._factorise()
            self._factorise = None
        return self._system

    @property
    def note(self) -> str:
        """What users should know of how the system was factorised, if it was."""
        return "" if self._system is None else self._system.note
