"""Checks of a run: a value and its limit, and the loop that warns, fails and keeps them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from mlsanm_cli.app.checks.limits import LIMITS
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Outcome = Literal["passed", "warned", "failed"]
OUTCOMES: Sequence[Outcome] = ("passed", "warned", "failed")


@dataclass(frozen=True)
class Check:
    """A ``value`` to be compared with the limit ``name``. ``message`` and ``hint`` are shown if it is
    exceeded; ``place`` is the body, contact or load with the value, "" for the whole scene. Two checks of the
    same name and place are of the same quantity. ``warns`` and ``fails`` replace the levels of the limit."""

    name: str
    value: float
    message: str
    hint: str = ""
    place: str = ""
    warns: float | None = None
    fails: float | None = None

    @property
    def text(self) -> str:
        return f"{self.message}; {self.hint}" if self.hint else self.message

    @property
    def judged(self) -> tuple[Outcome, float | None]:
        """The outcome and the level that decides it: the one exceeded, or else the first one."""
        known, sign = LIMITS[self.name], -1.0 if LIMITS[self.name].lower else 1.0
        warns = known.warns if self.warns is None else self.warns
        fails = known.fails if self.fails is None else self.fails
        outcomes: tuple[tuple[Outcome, float | None], ...] = (("failed", fails), ("warned", warns))
        for outcome, level in outcomes:
            # A value that is nan exceeds every level.
            if level is not None and not sign * (self.value - level) <= COARSE_ROUND_OFF * abs(level):
                return outcome, level
        return "passed", fails if warns is None else warns

    @property
    def outcome(self) -> Outcome:
        return self.judged[0]

    @property
    def severity(self) -> tuple[int, float]:
        sign = -1.0 if LIMITS[self.name].lower else 1.0
        return OUTCOMES.index(self.outcome), float(np.nan_to_num(sign * self.value, nan=np.inf))

    @property
    def row(self) -> dict[str, Any]:
        outcome, limit = self.judged
        known = {"name": self.name, "place": self.place, "value": self.value}
        return {**known, "limit": limit, "outcome": outcome}


def all_of(checks: Iterable[Callable[..., Iterable[Check]]], *subject: Any) -> Iterator[Check]:
    """All results of registered ``checks`` of a subject."""
    for check in checks:
        yield from check(*subject)


class Verdicts:
    """The worst check of every quantity so far; ``warn`` is called with the first of each that warns."""

    def __init__(self, warn: Callable[[Check], None]) -> None:
        self._warn = warn
        self._worst: dict[tuple[str, str], Check] = {}

    def judge(self, checks: Iterable[Check]) -> None:
        """Keep the ``checks`` and warn. Raises NumericalError at the first that fails."""
        for check in checks:
            key = check.name, check.place
            before = self._worst.get(key)
            if before is None or check.severity > before.severity:
                self._worst[key] = check
            if check.outcome == "failed":
                raise NumericalError(check.message, check.hint)
            if check.outcome == "warned" and (before is None or before.outcome == "passed"):
                self._warn(check)

    @property
    def rows(self) -> list[dict[str, Any]]:
        return [check.row for check in self._worst.values()]

    @property
    def plain(self) -> list[dict[str, Any]]:
        """The kept checks as plain values, for checkpoints."""
        return [vars(check) for check in self._worst.values()]

    def take_up(self, plain: Iterable[Mapping[str, Any]]) -> list[str]:
        """Continue with the checks of an earlier process; returns its warnings that are new to this one."""
        checks = [Check(**stored) for stored in plain]
        known = set(self._worst)
        self._worst = {(check.name, check.place): check for check in checks} | self._worst
        return [
            check.text
            for check in checks
            if (check.name, check.place) not in known and check.outcome == "warned"
        ]
