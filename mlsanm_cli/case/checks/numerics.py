"""Checks of approximation, refinement, solver, contact laws and output."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from mlsanm_cli.case.checks.valid_parts import ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.case import Contact
from mlsanm_cli.case.report import Report

MAX_NEIGHBORS_PER_TERM = 20
"""Largest number of nodes of a stencil per coefficient of its polynomial."""
MIN_AUTO_DEGREE = 2
"""Lowest degree that "auto" selects."""


def check_numerics(parts: ValidParts, report: Report) -> None:
    case = parts.case
    if case.mls.neighbors != "auto":
        degree = case.mls.degree if case.mls.degree != "auto" else MIN_AUTO_DEGREE
        terms = (degree + 1) * (degree + 2) // 2
        path: KeyPath = ("mls", "neighbors")
        of = f"the {terms} terms of degree {degree}"
        if case.mls.neighbors < terms:
            hint = f'at least {terms}, better twice as many, or "auto"'
            report.add(path, f"{case.mls.neighbors} nodes are too few for {of}", hint)
        elif case.mls.neighbors > MAX_NEIGHBORS_PER_TERM * terms:
            hint = f'at most {MAX_NEIGHBORS_PER_TERM * terms}, or "auto"'
            report.add(path, f"{case.mls.neighbors} nodes are too many for {of}", hint)
    _check_laws(parts, report, [one for one in case.contact if not one.bonded])
    if case.adapt.passes:
        fixed = [body.name for body in case.body if body.has_nodes]
        if fixed:
            message = f'body "{fixed[0]}" cannot be refined: its nodes come from a file'
            report.add(("adapt", "passes"), message, 'write 0, or take the outline only: use = "outline"')
        if case.contact and not case.touching:
            hint = "write 0, and refine along the bonds and at their ends with [[body.refine]]"
            report.add(("adapt", "passes"), "bonded contacts are not refined automatically", hint)
    for field, times in Counter(case.output.fields).items():
        if times > 1:
            report.add(("output", "fields"), f'"{field}" is listed {times} times')
    stages = parts.count("stage") if "stage" in parts.data else 1
    for index, position in enumerate(case.output.at):
        if not 0.0 <= position <= stages:
            message = f"{position:g} is outside the path, which goes from 0 to {stages}"
            report.add(("output", "at", index), message, "a position is the stage index + fraction")


def _check_laws(parts: ValidParts, report: Report, contacts: Iterable[Contact]) -> None:
    laws = {contact.name: contact.regularization.law for contact in contacts}
    first = next(iter(laws.values()), None)
    for index, contact in parts.contacts.items():
        if not contact.bonded and contact.regularization.law != first:
            message = f'"{contact.regularization.law}" here, "{first}" in another contact'
            hint = "use one law in all contacts; mixed laws are not supported yet"
            report.add(("contact", index, "regularization", "law"), message, hint)
    _check_friction_laws(parts, report)
    if first is None and "contact" in parts.incomplete:
        return
    solver = parts.case.solver
    if solver.polish is True and first != "hyperbolic":
        why = "the contact law is exact already" if first else "there is no [[contact]]"
        report.add(("solver", "polish"), f"nothing to polish: {why}", "remove it, or set it to false")
    fitting = {"anm": "hyperbolic", "newton": "hyperbolic", "active-set": "exact"}.get(solver.method, first)
    if first not in (None, fitting):
        message = f'"{solver.method}" cannot solve the {first} contact law'
        hint = f'law = "{fitting}" in [contact.regularization], or method = "auto"'
        report.add(("solver", "method"), message, hint)
    if solver.formulation == "monolithic":
        _check_monolithic(parts, first, report)


def _check_monolithic(parts: ValidParts, law: str | None, report: Report) -> None:
    contacts = parts.case.contact
    tied = [c.name for c in contacts if c.bonded]
    rigid = [c.name for c in contacts if c.obstacle is not None or c.interference is not None]
    hint = 'formulation = "condensed"'
    if law is None:
        report.add(("solver", "formulation"), "the monolithic formulation needs a contact", hint)
    elif law != "hyperbolic":
        message = "the exact contact law is solved on the condensed system only"
        other = 'law = "hyperbolic" in [contact.regularization], or ' + hint
        report.add(("solver", "formulation"), message, other)
    if tied:
        message = f"bonds (contact {tied[0]}) need the condensed formulation"
        report.add(("solver", "formulation"), message, hint)
    if rigid:
        message = f"obstacles and interference (contact {rigid[0]}) need the condensed formulation"
        report.add(("solver", "formulation"), message, hint)


def _check_friction_laws(parts: ValidParts, report: Report) -> None:
    frictional = {
        index: contact for index, contact in parts.contacts.items() if contact.friction and not contact.bonded
    }
    first = next(iter(frictional.values()), None)
    for index, contact in frictional.items():
        here, path = contact.regularization, ("contact", index, "regularization", "friction_law")
        if first is not None and here.friction_law != first.regularization.friction_law:
            message = f'"{here.friction_law}" here, "{first.regularization.friction_law}" in another contact'
            report.add(path, message, "use one friction law in all contacts")
        if here.friction_law == "holonomic" and here.law == "exact":
            report.add(
                path,
                "holonomic friction needs the hyperbolic law",
                'law = "hyperbolic", or friction_law = "memory"',
            )
