"""``mlsanm compare`` at small strain: the regularised law by power series and Newton's method, and the exact
one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from mlsanm_cli.app.analysis.small_strain import set_up
from mlsanm_cli.app.checks.check import Check, Verdicts
from mlsanm_cli.app.checks.end import End, balance, pressed_spacings, work
from mlsanm_cli.app.checks.energy import energy_error
from mlsanm_cli.app.checks.quality import announce, factor_notes
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.comparison.compare import Changed, CompareOptions
from mlsanm_cli.app.comparison.measure import (
    CONVERGENCE_RATIO,
    SOFTER,
    Measured,
    Method,
    agreement,
    chosen_methods,
    compared,
    difference,
    measure,
    method_of,
    other_law_limit,
    same_law_limit,
    surface_error,
)
from mlsanm_cli.app.comparison.precision import precision_curves
from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.case import Case
from mlsanm_cli.errors import RunError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.state import State

SHARED_PHASES = ("cloud", "operators")
CONDENSED_PHASES = ("factorization", "condensation")
"""Set-up phases of all methods, and of condensed methods only."""


def refuse(case: Case, options: CompareOptions) -> None:
    """Raises RunError if there is nothing to compare."""
    if not case.touching:
        raise RunError(
            "the case has no unilateral [[contact]]: it is linear, and all methods are the same",
            "use mlsanm run",
        )
    if options.analytic and case.reference is None:
        raise RunError("--analytic: the case names no reference", "add [reference] with its solution")
    if len(chosen_methods(case, options.methods)) == 1 and not options.analytic:
        raise RunError("no method to compare with ANM", "add --newton, --active-set or --analytic")


def followed(
    options: CompareOptions, context: RunContext, changed: Changed, with_levels: Changed
) -> tuple[dict[str, Any], Mapping[str, Any]]:
    """Follows the path by all methods; entries of comparison.json, and curves of the picture."""
    case = changed().case

    def case_of(method: Method) -> Case:
        return with_levels(*method.changes).case

    methods = chosen_methods(case, options.methods)
    cases = list(map(case_of, methods))
    # All methods share the nodal pressures of the regularised law.
    shared, warnings = changed(*methods[0].changes), list[str]()
    prepared = build_scene(shared, context)
    verdicts = Verdicts(lambda check: warnings.append(check.text))
    announce(shared.case, prepared, context, verdicts)
    built = replace(set_up(shared.case, prepared, context, verdicts).built, case=case)
    rows = []
    for method, changes in zip(methods, cases, strict=True):
        context.console.phase(f"following the path: {method.name}")
        rows.append(measure(built, method, changes, options.repeat))
    warnings += factor_notes(built.scene)
    if rows[0].done:
        verdicts.judge(_checked(built, rows[0].states[max(rows[0].states)]))
    result = _result(built, rows, options, context.clock, case_of)
    curves: Mapping[str, Any] = {}
    if options.picture and rows[0].done:
        context.console.phase("following the paths at larger eta, for the picture")
        curves = precision_curves(built, rows, case_of)
        result["precision"] = curves
        if not curves["smooth"]:
            warnings.append("no picture: the exact law has no state at some level")
    return result | {"warnings": warnings}, curves


def _checked(built: CondensedScene, last: State) -> Iterator[Check]:
    """Checks of the ``last`` state of ANM."""
    fields, _ = fields_of(built, [last], stress=True)[0]
    done = End(built, None, last, 0.0, energy_error(built, last, fields), {})
    for check in (pressed_spacings, balance, work):
        yield from check(done)


def _result(
    built: CondensedScene,
    rows: Sequence[Measured],
    options: CompareOptions,
    clock: Clock,
    case_of: Callable[[Method], Case],
) -> dict[str, Any]:
    case = built.case
    limits = {
        "same_law": same_law_limit(case) if options.tolerance is None else options.tolerance,
        "other_law": other_law_limit(case),
    }
    table = [_figures(built, row, rows, limits, clock, options.analytic, case_of) for row in rows]
    return {
        "status": agreement(table),
        "levels": sorted(rows[0].states),
        "limits": limits,
        "nodes": sum(len(body.model.cloud.points) for body in built.scene.bodies.values()),
        "contact_unknowns": len(built.condensed.weight) + len(built.condensed.friction_nodes),
        "eta": {contact.name: contact.regularization.eta for contact in case.contact},
        "methods": table,
    }


def _figures(
    built: CondensedScene,
    row: Measured,
    rows: Sequence[Measured],
    limits: Mapping[str, float],
    clock: Clock,
    analytic: bool,
    case_of: Callable[[Method], Case],
) -> dict[str, Any]:
    """One method as in comparison.json."""
    exact = row.method.is_exact
    phases = (*SHARED_PHASES, *CONDENSED_PHASES) if exact else SHARED_PHASES
    condensed = (len(built.scene.bodies), built.condensed.solves) if exact else None
    found = row.row(sum(clock.seconds[phase] for phase in phases), condensed)
    if not row.done:
        return found
    if analytic:
        found["reference_error"] = _reference_error(built, row)
    before = [one for one in rows[: rows.index(row)] if one.done]
    # The first of the preceding methods with the same law, else ANM.
    against = next(iter([*(one for one in before if one.law == row.law), *before]), None)
    if against is not None:
        limit = limits["same_law" if against.law == row.law else "other_law"]
        apart = difference(built, row.states, against.states)
        found |= compared(against.method.name, apart, limit)
        if against.law != row.law and not found["agrees"]:
            errors = _errors_by_law(built, row, against, case_of)
            found |= {"convergence": errors, "agrees": errors[1] <= CONVERGENCE_RATIO * errors[0]}
    return found


def _errors_by_law(
    built: CondensedScene, row: Measured, against: Measured, case_of: Callable[[Method], Case]
) -> tuple[float, float]:
    """L2 errors of the regularised law with larger parameters (0 if that fails) and with those of the
    case."""
    smooth, exact = (against, row) if row.law == "exact" else (row, against)
    method = method_of(built.case, smooth.method.name, SOFTER)
    softer = measure(built, method, case_of(method))
    before = surface_error(built, softer.states, exact.states) if softer.done else 0.0
    return before, surface_error(built, smooth.states, exact.states)


def _reference_error(built: CondensedScene, row: Measured) -> dict[str, float | None]:
    """L2 error of the pressure of every contact at the end of the path against the analytical solution."""
    profiles = {
        pairing.name: reference_profile(built, pairing, row.states[max(row.states)])
        for pairing in built.condensed.pairings
    }
    return {name: None if profile is None else profile.error_l2 for name, profile in profiles.items()}
