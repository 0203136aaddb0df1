"""Checks of the reliability of a result, which a run must pass to end with status done."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, finer_nodes
from mlsanm_cli.contact.geometry.pairing import spacing_ratio
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.stage_ends import passing_error, reach_error
from mlsanm_cli.solve.state import UNLOADED, State

BALANCE_LIMIT = 0.1
"""Largest accepted force imbalance of a body, relative to the forces on it. Reactions are computed from the
stress, independently of the applied forces. On clamped beams the imbalance was as large as the error of the
deflection."""
BALANCE_WARNING = 0.03

TRANSFER_LIMIT = 0.1
"""Largest accepted difference of the forces on slave and master of a contact, relative to its normal force.
In random scenes of two bodies with transfer that does not conserve forces it was up to 49 %."""
TRANSFER_WARNING = 0.03

ENERGY_LIMIT = 0.1
"""Largest accepted difference between twice the strain energy of a body and the work done on it, relative to
the work.

On clamped beams it was the error of the deflection within a percent, and in some scenes no other check
failed.
"""
ENERGY_WARNING = 0.03

SPACING_LIMIT = 4.0
"""Largest accepted ratio of facing spacings in contact; beyond, pressures are wrong but look plausible."""

CONE_TOLERANCE = 1e-8
"""Largest excess of tractions over their friction limits at the ends of stages, relative to the peak
pressure."""

LINEAR_LIMIT = 1e-6
"""Largest relative change of an elastic solution by iterative refinement."""


ESTIMATE_WARNING = 0.02
"""Estimated error of pressures, relative to their L2 norm, above which a run warns."""

LARGE_ERROR = 0.05
"""Estimated error of pressures with friction or on nodes above which a run warns."""


@dataclass(frozen=True)
class EnergyVerdict:
    """By body the relative difference of twice the strain energy and the work, the strain, the relative
    increase of the work at single supported nodes with half the spacing (``pointed``) and a description of
    parts with too few nodes across (``thin``). ``deflection`` is the root mean square error of the
    displacements, relative, as far as only the energies show it."""

    bodies: Mapping[str, float]
    strains: Mapping[str, float] = field(default_factory=dict)
    pointed: Mapping[str, float] = field(default_factory=dict)
    thin: Mapping[str, str] = field(default_factory=dict)
    deflection: float = 0.0


def worst_of(errors: Mapping[str, float]) -> str:
    """The body with the error largest in magnitude, or with nan."""
    return max(errors, key=lambda name: np.nan_to_num(abs(errors[name]), nan=np.inf))


def force_balance(built: CondensedScene, state: State) -> dict[str, float]:
    """Resultant of all forces on each body over the largest force on it, in a state."""
    unbalanced = built.condensed.imbalance(*state.unknowns).reshape(-1, 2)
    per_body = {}
    for number, name in enumerate(built.scene.bodies):
        largest = max(largest_force(built, name, state.unknowns), least_force(built, name))
        size = float(np.hypot(*unbalanced[number]))
        per_body[name] = 0.0 if largest == 0.0 else size / largest
    return per_body


def largest_force(built: CondensedScene, body: str, unknowns: Sequence[FloatArray]) -> float:
    """Largest force on a body in a state f, q, p, t. The magnitudes of pressures, tractions and body forces
    are summed, so that press fits and couples, whose resultants vanish, count."""
    condensed, (factors, _, pressure, _) = built.condensed, unknowns
    sizes = [
        float(condensed.weight[span] @ np.abs(pressure[span]))
        for pairing, span in zip(condensed.pairings, condensed.spans.values(), strict=True)
        if body in pairing.bodies
    ]
    for pairing in condensed.bonds.pairings:
        if body in pairing.bodies:
            size = np.hypot(*condensed.bonds.values(pairing.name, unknowns))
            sizes.append(float(pairing.weight[pairing.candidate] @ size))
    maps = [condensed.forces[load.name] for load in built.case.load if body in load.owners]
    sizes += [abs(factors[number]) * size for number, size in built.scene.sizes[body]]
    sizes.append(built.scene.heat_force(body, factors))
    return float(np.max([*sizes, *(np.hypot(*force(*unknowns)) for force in maps)]))


def least_force(built: CondensedScene, body: str) -> float:
    """Force below which those on a body are not checked, from those at the ends of stages: on it, and, if
    nothing loads it, on all."""
    sizes = {
        name: max((largest_force(built, name, end.unknowns) for end in built.ends), default=0.0)
        for name in built.scene.bodies
    }
    return max(UNLOADED * sizes[body], ROUND_OFF * max(sizes.values()))


def check_state(built: CondensedScene, state: State) -> None:
    """Raise NumericalError when a state on the path is not reliable."""
    condensed = built.condensed
    tolerance = built.case.solver.tolerance
    if not state.residual <= tolerance:
        raise NumericalError(
            f"the residual {state.residual:.3g} at position {state.position:.6g} is above the tolerance",
            "raise solver.tolerance only if that residual is small enough for your purpose",
        )
    if not state.is_finite:
        raise NumericalError(f"the state at position {state.position:.6g} is not finite")
    _check_cone(built, state)
    touched = condensed.touched(*state.unknowns)
    for pairing in condensed.pairings:
        gaps = pairing.gap[touched[pairing.name]]
        if len(gaps):
            name, gap = pairing.name, float(gaps.max())
            reach = next(one.reach for one in built.case.contact if one.name == name)
            raise passing_error(name, gap, state.position) if reach == "auto" else reach_error(name, gap)


def _check_cone(built: CondensedScene, state: State) -> None:
    """NumericalError if tractions exceed the friction limit; regularised laws may, by mu eta."""
    condensed = built.condensed
    if not len(condensed.friction_nodes):
        return
    limit = condensed.friction * np.maximum(state.pressure[condensed.friction_nodes], 0.0)
    beyond = np.abs(state.traction) - limit
    peak = max(float(end.pressure.max()) for end in built.ends)
    smooth = [
        contact.coefficient * contact.regularization.eta
        for contact in built.case.touching
        if contact.regularization.law != "exact"
    ]
    if not beyond.max() <= max(CONE_TOLERANCE, *smooth, 0.0) * peak:
        raise NumericalError(
            f"a traction is beyond the friction limit at position {state.position:.6g}",
            'lower solver.tolerance, or use contact.regularization.law = "exact"',
        )


def _judged(error: float, warning: float, limit: float, message: str, hint: str) -> str:
    """A warning of an error above the level ``warning`` ("" below). NumericalError above the ``limit``."""
    if not error <= limit:
        raise NumericalError(message, hint)
    return f"{message}; {hint}" if error > warning else ""


def check_balance(case: Case, imbalance: Mapping[str, float]) -> str:
    """Warning of a force imbalance ("" if there is none). NumericalError above the limit."""
    worst = worst_of(imbalance)
    message = f"force imbalance on body {worst}: {100 * imbalance[worst]:.2g} % of the largest force"
    hint = f"{finer_nodes(case, [worst])} where it is held and around its notches, or use mls.degree = 4"
    return _judged(imbalance[worst], BALANCE_WARNING, BALANCE_LIMIT, message, hint)


def force_mismatch(built: CondensedScene, state: State) -> dict[str, float]:
    """Difference of the forces on slave and master over the normal force, by contact."""
    found = {}
    for name, span in built.condensed.spans.items():
        pressed = float(built.condensed.weight[span] @ np.abs(state.pressure[span]))
        lost = float(np.hypot(*built.condensed.mismatches[name](*state.unknowns)))
        found[name] = lost / pressed if pressed else 0.0
    return found


def check_transfer(built: CondensedScene, state: State) -> list[str]:
    """For every contact a warning of different forces on slave and master ("" if there is none).
    NumericalError above the limit."""
    texts, mismatches = [], force_mismatch(built, state)
    for pairing in built.condensed.pairings:
        lost = mismatches[pairing.name]
        keys = " and ".join(f"body.{body}.spacing" for body in pairing.bodies)
        message = f"contact {pairing.name}: the forces on slave and master differ by {100.0 * lost:.2g} %"
        hint = f"bring {keys} closer together where they touch, or {finer_nodes(built.case, pairing.bodies)}"
        texts.append(_judged(lost, TRANSFER_WARNING, TRANSFER_LIMIT, message, hint))
    return texts


def check_energy(case: Case, verdict: EnergyVerdict) -> str:
    """Warning of a difference between strain energy and work ("" if there is none). NumericalError above the
    limit."""
    worst = worst_of(verdict.bodies)
    error = verdict.bodies[worst]
    size = f"{100 * abs(error):.2g} % {'below' if error < 0.0 else 'above'}"
    message = f"twice the strain energy of body {worst} is {size} the work done on it"
    where = verdict.thin.get(worst) or "where it is held and around its notches"
    hint = f"{finer_nodes(case, [worst])}, above all {where}"
    return _judged(abs(error), ENERGY_WARNING, ENERGY_LIMIT, message, hint)


def check_points(verdict: EnergyVerdict) -> Iterator[str]:
    """Warnings of bodies held at single nodes whose displacements depend on the spacing."""
    for name, part in verdict.pointed.items():
        if part > ENERGY_WARNING:
            yield (
                f"body {name} is held at single nodes: displacements next to a point force are unbounded, "
                f"and grow by about {100 * part:.2g} % when its spacing is halved; support a part of a "
                f"boundary (from, to), or measure displacements relative to another point than the fixed one"
            )


def check_open(built: CondensedScene) -> str:
    """Warning if no contact carries pressure at the end of any stage ("" otherwise)."""
    if not built.case.touching or not built.stays_open:
        return ""
    return (
        "no contact carries any pressure at the end of any stage; check the direction and size of the loads"
    )


FORCE_WARNING = 0.005
"""Estimated error of the force of a contact above which a run warns."""
PLACE_WARNING = 0.02
"""Estimated error of displacements above which a run warns. For half-disks of four nodes per radius the
estimate is up to 1.6 %, the error 0.1 %."""


def estimate_limits(built: CondensedScene) -> dict[str, Any]:
    """Limits of the error estimates of summary.json above which a run warns. Those of pressures are lower for
    frictionless contacts with contact grids, whose errors come from bodies that are too coarse."""
    pressures = {
        one.name: ESTIMATE_WARNING if one.grid is not None and not one.friction else LARGE_ERROR
        for one in built.condensed.pairings
    }
    places = dict.fromkeys(built.condensed.probes, PLACE_WARNING)
    forces = dict.fromkeys(pressures, FORCE_WARNING)
    return {"displacement": PLACE_WARNING, "pressure": pressures, "force": forces, "probes": places}


def check_estimates(
    built: CondensedScene,
    estimates: Mapping[str, Any],
    missing: str = "",
) -> list[str]:
    """Warnings of displacements, forces and pressures with large estimated errors, or that estimates are
    ``missing``, and why."""
    texts, displacement = [], estimates["displacement"]
    if displacement is None and missing:
        return [f"errors are not estimated: {missing}"]
    limits = estimate_limits(built)["pressure"]
    coarse = finer_nodes(built.case, built.scene.bodies)
    places = estimates.get("probes") or {}
    worst = max(places, key=places.__getitem__, default="")
    error, what = displacement or 0.0, "displacements are"
    if places and places[worst] > max(error, PLACE_WARNING):
        error, what = places[worst], f"the displacement at probe {worst} is"
    if error > PLACE_WARNING:
        texts.append(
            f"{what} estimated to be off by {100 * error:.2g} %; {coarse}, above all where bodies are "
            "held, loaded or bent"
        )
    for pairing in built.condensed.pairings:
        force = (estimates.get("force") or {}).get(pairing.name, 0.0)
        if force > FORCE_WARNING:
            texts.append(
                f"contact {pairing.name}: its force is estimated to be off by {100 * force:.2g} %; "
                f"{coarse}, above all where bodies are held"
            )
        error = estimates["pressure"].get(pairing.name)
        if error is not None and error > limits[pairing.name]:
            hint = finer_nodes(built.case, pairing.bodies)
            if pairing.grid is not None and pairing.friction:
                hint += f" and a smaller contact.{pairing.name}.accuracy"
            texts.append(
                f"contact {pairing.name}: pressures are estimated to be off by {100 * error:.2g} %; {hint}"
            )
    return texts


def check_linear(residual: float) -> None:
    """NumericalError if the elastic systems were not solved accurately enough."""
    if not residual <= LINEAR_LIMIT:
        raise NumericalError(
            f"linear-solver error {residual:.2g} exceeds {LINEAR_LIMIT:g}",
            "make the spacings more equal, use a lower mls.degree, or a Poisson's ratio less close to 0.5",
        )


def check_spacing(built: CondensedScene, state: State) -> None:
    """NumericalError if the spacings of surfaces in contact differ too much."""
    clouds = {name: body.model.cloud for name, body in built.scene.bodies.items()}
    for pairing in built.condensed.pairings:
        if pairing.grid is not None:
            continue
        closed = np.zeros_like(pairing.candidate)
        closed[pairing.candidate] = state.closed[built.condensed.spans[pairing.name]]
        pressed = replace(pairing, candidate=closed)
        ratio = spacing_ratio(pressed, clouds)
        if not ratio <= SPACING_LIMIT:
            raise NumericalError(
                f"contact {pairing.name}: spacings of the surfaces in contact differ by a factor of "
                f"{ratio:.3g}",
                f"bring the spacings of {' and '.join(pairing.names)} closer together where they touch",
            )
