"""Checks of a run: their limits by name, which ``docs/troubleshooting.md`` shows as a table, a value that is
compared with one, and the loop that warns, fails and keeps them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from mlsanm_cli.contact.response.coercivity import CONTACT_LIMIT
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.state import INSTABILITY_RATIO


class Limit(NamedTuple):
    """Levels of a check: a run warns above ``warns`` and fails above ``fails`` (with ``lower``, below them),
    never for None. ``meaning`` defines the value that is compared."""

    warns: float | None
    fails: float | None
    meaning: str
    lower: bool = False


ANY = 0.0
"""Level of checks whose value is a number of places."""

MODEL: Mapping[str, Limit] = {
    "node_distance": Limit(0.5, None, "smallest distance of two nodes over the local spacing", lower=True),
    "node_hole": Limit(1.6, None, "radius of the largest circle without nodes over the local spacing"),
    "spacing_growth": Limit(0.3, None, "growth of the spacing per unit length"),
    "mesh_growth": Limit(0.6, None, "growth of the spacing per unit length between nodes of a file"),
    "facing_spacings": Limit(2.0, None, "ratio of the spacings of facing surfaces with nodal pressures"),
    "slave_stiffness": Limit(3.0, None, "stiffness of a slave with nodal pressures over that of its master"),
    "contact_corner": Limit(ANY, None, "corners inside a contact surface, where contact grids end"),
    "crack_tip": Limit(ANY, None, "ends of a contact at which a bond of the same bodies begins"),
    "bonded_curve": Limit(0.22, None, "rotation of a bonded surface from node to node (radian)"),
    "degree": Limit(2.0, None, "lowest `mls.degree`", lower=True),
    "initial_gap": Limit(0.25, None, "initial gap of a contact over the size of the smaller body"),
    "load_resolution": Limit(0.08, None, "error of a load interpolated between nodes over its largest value"),
    "loaded_length": Limit(0.01, None, "relative error of the length of a loaded part, with nodes of a file"),
    "weak_motion": Limit(ANY, None, "motions along the surfaces in contact that are hardly resisted"),
    "reentrant_corners": Limit(ANY, None, "sharp corners that point into the material of a body"),
    "plane_stiffness": Limit(ANY, None, "materials whose stress out of the plane is not known"),
    "moduli": Limit(3e5, None, "largest modulus over the smallest; that of steel over soft rubber is 3e5"),
    "pulled_apart": Limit(ANY, None, "bodies that loads pull away from the only contact that holds them"),
    "cut_body": Limit(
        ANY, None, "bodies cut at a plane of symmetry whose edges press on bodies that are not"
    ),
    "friction_coefficient": Limit(4.0, None, "coefficient of friction; that of rubber is up to 4"),
    "refinement_pass": Limit(ANY, None, "passes of a refinement that failed; results are those before it"),
}
"""Checks of the model, before the path."""

STATE: Mapping[str, Limit] = {
    "residual": Limit(None, None, "residual of the contact problem; a run fails above `solver.tolerance`"),
    "finite": Limit(None, ANY, "states with numbers that are not finite"),
    "friction_limit": Limit(None, 1e-8, "tractions beyond the friction limit over the peak pressure"),
    "contact_reach": Limit(None, ANY, "nodes left out of a contact that have come into contact"),
    "overlap": Limit(None, ANY, "boundaries inside a body or an obstacle without a contact there"),
    "self_overlap": Limit(ANY, None, "points of a boundary inside its own body; fails at finite strain"),
    "sliding_distance": Limit(0.25, None, "sliding at small strain over the width of the contact"),
    "uniqueness": Limit(ANY, None, "motions along contacts with friction that no force determines"),
    "snap": Limit(ANY, None, "jumps of a contact with friction, whose path is not continuous"),
    "body_rotation": Limit(
        0.03, INSTABILITY_RATIO, "moment of forces by the rotation of a body over the moment that resists it"
    ),
    "stability": Limit(
        None, CONTACT_LIMIT, "stiffness against pressures that alternate from node to node", lower=True
    ),
    "equilibrium": Limit(ANY, None, "motions of a state in equilibrium that lower its energy"),
    "volume_ratio": Limit(None, 0.0, "least determinant of the deformation gradient", lower=True),
    "ellipticity": Limit(
        0.1, 0.0, "least eigenvalue of the acoustic tensor over the shear modulus", lower=True
    ),
}
"""Checks of every state of the path."""

END: Mapping[str, Limit] = {
    "increment_error": Limit(0.015, None, "estimated error of forces by increments of friction"),
    "bifurcation": Limit(ANY, None, "bifurcations of the path where no asymmetry of the scene decides"),
    "linear_residual": Limit(None, 1e-6, "change of an elastic solution by one more iterative refinement"),
    "pressed_spacings": Limit(None, 4.0, "ratio of the spacings of surfaces pressed on each other by nodes"),
    "initial_overlap": Limit(0.01, None, "pressures before any load over those at the end of the path"),
    "contact_end": Limit(0.2, None, "pressure where a surface continues smoothly, over the mean pressure"),
    "peak_pressure": Limit(0.5, None, "peak pressure off the ends of a contact over the contact modulus"),
    "strain": Limit(0.1, None, "strain or rotation of a body at small strain"),
    "force_mismatch": Limit(0.03, 0.1, "difference of the forces on slave and master over their size"),
    "force_balance": Limit(0.03, 0.1, "sum of all forces on a body over the largest of them"),
    "energy_error": Limit(0.03, 0.1, "twice the strain energy of a body over the work done on it, minus 1"),
    "series_energy_error": Limit(0.01, 0.1, "the same of a path by power series at finite strain"),
    "single_nodes": Limit(0.03, None, "growth of displacements at single held nodes with half the spacing"),
    "peak_stress": Limit(0.03, None, "estimated error of the largest stress on a free boundary"),
    "held_motion": Limit(0.01, None, "part of a contact force along a motion that is fixed at 0"),
    "limit_load": Limit(0.01, None, "part of a limit load from contacts that do not move as they should"),
    "law_gap": Limit(0.02, None, "mean gap below pressures of the regularised law over the displacements"),
    "no_pressure": Limit(ANY, None, "scenes without contact pressure at the end of any stage"),
    "missing_estimates": Limit(ANY, None, "missing error estimates"),
    "displacement_error": Limit(0.02, None, "estimated error of displacements, of the whole or at a probe"),
    "force_error": Limit(0.005, None, "estimated error of a contact force over the sum of its pressures"),
    "pressure_error": Limit(0.02, None, "estimated error of frictionless pressures on contact grids (L2)"),
    "rough_pressure_error": Limit(0.05, None, "estimated error of pressures with friction or on nodes (L2)"),
    "located_contacts": Limit(ANY, None, "path beyond the position up to which its contacts were located"),
    "folded_nodes": Limit(ANY, None, "nodes at which the deformation is not invertible: without stresses"),
    "energy_estimate": Limit(0.015, None, "estimated error of the energy at finite strain"),
    "finite_force_error": Limit(0.015, None, "estimated error of a contact force over the largest force"),
}
"""Checks of a completed path. Reactions are computed from stresses, independently of the applied forces;
errors of the energy are those of the deflection of beams."""

LIMITS: Mapping[str, Limit] = {**MODEL, **STATE, **END}


def level(name: str) -> float:
    """The first level of a check that has one."""
    known = LIMITS[name]
    found = known.fails if known.warns is None else known.warns
    assert found is not None
    return found


def summary_limits(
    tolerance: float, fails: Sequence[str], estimate: str, estimates: Mapping[str, Any]
) -> dict[str, Any]:
    """The levels for summary.json: those at which a run fails, among them the ``tolerance`` of the residual,
    and those at which it warns of an ``estimate`` and of all ``estimates``."""
    return {
        "residual": tolerance,
        **{name: LIMITS[name].fails for name in fails},
        "error_estimate": level(estimate),
        **({"estimates": estimates} if estimates else {}),
    }


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
        new = [check for check in checks if (check.name, check.place) not in self._worst]
        self._worst = {(check.name, check.place): check for check in checks} | self._worst
        return [check.text for check in new if check.outcome == "warned"]
