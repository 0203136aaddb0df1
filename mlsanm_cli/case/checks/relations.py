"""Checks of relations in a case: names, references, and values that depend on each other."""

from __future__ import annotations

from dataclasses import replace

from mlsanm_cli.case.checks.bodies import check_body, check_materials, check_spacing, geometries_of
from mlsanm_cli.case.checks.conditions import check_conditions
from mlsanm_cli.case.checks.finite import check_finite
from mlsanm_cli.case.checks.load_checks import check_ends, check_loads
from mlsanm_cli.case.checks.numerics import check_numerics
from mlsanm_cli.case.checks.valid_parts import GeometryInspector, ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import BOUNDARY_PATTERN, split_boundary
from mlsanm_cli.case.model.case import Contact
from mlsanm_cli.case.model.loads import ObstacleMotion, Platen
from mlsanm_cli.case.model.obstacles import check_obstacle
from mlsanm_cli.case.model.stop import check_stop
from mlsanm_cli.case.report import Report, suggestion

RESTRAINING_SECTIONS = ("model", "body", "support", "load", "contact")
"""Sections that determine whether a body can move freely."""


def run_checks(parts: ValidParts, inspector: GeometryInspector | None, report: Report) -> ValidParts:
    """Adds every conflict between the valid parts of the case; returns these with the geometries of their
    shapes. Without ``inspector`` nothing that depends on geometry is checked."""
    parts = replace(parts, geometries=geometries_of(parts, inspector, report))
    _check_names(parts, report)
    check_materials(parts, report)
    _check_references(parts, report)
    for index, body in parts.bodies.items():
        check_spacing(body, index, report)
        if index in parts.geometries:
            check_body(body, parts.geometries[index], index, report)
    check_loads(parts, report)
    _check_contacts(parts, report)
    _check_stages(parts, report)
    _check_stops(parts, report)
    check_numerics(parts, report)
    check_conditions(parts, report)
    check_finite(parts, report)
    # Otherwise a fault in a support would be reported again as a body that can move.
    restraints_valid = not any(report.touches((section,)) for section in RESTRAINING_SECTIONS)
    if inspector is not None and restraints_valid:
        for fault in inspector.floating(parts.case):
            report.add(fault.key, fault.message, fault.hint)
    return parts


def _check_names(parts: ValidParts, report: Report) -> None:
    for section in ("body", "load", "contact", "probe"):
        first: dict[str, int] = {}
        for index, name in parts.names(section):
            if name in first:
                report.add((section, index, "name"), f'another {section} is called "{name}" already')
            first.setdefault(name, index)


def _check_references(parts: ValidParts, report: Report) -> None:
    """Adds unknown names of bodies and boundaries, also of items with other faults."""
    names = [known for _, known in parts.names("body")]
    for section in ("support", "load", "probe"):
        for index, name in parts.texts(section, "body"):
            if name not in names:
                hint = suggestion(name, names, "bodies")
                report.add((section, index, "body"), f'there is no body "{name}"', hint)
    for section, key in (
        ("support", "boundary"),
        ("load", "boundary"),
        ("contact", "slave"),
        ("contact", "master"),
    ):
        for path, boundary in parts.boundaries(section, key):
            if BOUNDARY_PATTERN.fullmatch(boundary):
                _check_boundary(parts, report, path, boundary)


def _check_boundary(parts: ValidParts, report: Report, path: KeyPath, boundary: str) -> None:
    name, edge = split_boundary(boundary)
    names = [known for _, known in parts.names("body")]
    if name not in names:
        near = suggestion(name, names, "bodies")
        report.add(path, f'"{boundary}": there is no body "{name}"', near)
        return
    edges = parts.edges(name)
    if edges and edge not in edges:
        options = [f"{name}.{valid}" for valid in edges]
        hint = suggestion(boundary, options, "boundaries")
        report.add(path, f'body "{name}" has no boundary "{edge}"', hint)


def _check_contacts(parts: ValidParts, report: Report) -> None:
    pairs: dict[tuple[frozenset[str], object], str] = {}
    for index, contact in parts.contacts.items():
        path: KeyPath = ("contact", index)
        check_ends(contact, path, report)
        if (contact.master is None) == (contact.obstacle is None):
            hint = "a boundary of another body, or a rigid obstacle"
            report.add(path, "needs exactly one of master and obstacle", hint)
            continue
        if contact.obstacle is not None:
            check_obstacle(contact.obstacle, (*path, "obstacle"), report)
        if contact.master is None:
            if contact.bonded:
                hint = "fix the boundary with a [[support]], or move it with a platen"
                report.add((*path, "friction"), "bonding to a rigid obstacle is not possible", hint)
            continue
        both = set(contact.sides[0].boundaries) & set(contact.sides[1].boundaries)
        if both:
            single = len(contact.boundaries) == 2
            message = (
                "slave and master are the same boundary"
                if single
                else f"{both.pop()} is part of the slave too"
            )
            report.add((*path, "master"), message)
            continue
        bodies = {split_boundary(boundary)[0] for boundary in contact.boundaries}
        if len(bodies) == 1:
            message = f"self-contact (body {bodies.pop()}) is not supported yet"
            report.add(path, message, "slave and master must belong to two bodies")
        if contact.bonded:
            _check_bond(contact, path, report)
        pair = frozenset(contact.boundaries), contact.ends
        if pair in pairs:
            report.add(path, f'the same two boundaries as contact "{pairs[pair]}"')
        pairs.setdefault(pair, contact.name)


def _check_bond(contact: Contact, path: KeyPath, report: Report) -> None:
    """Adds keys that do not apply to bonded surfaces."""
    plain = Contact(name=contact.name, slave=contact.slave, master=contact.master)
    for key in ("interference", "gap", "reach", "regularization"):
        if getattr(contact, key) != getattr(plain, key):
            report.add((*path, key), "does not apply to bonded surfaces", "remove it")


def _check_stages(parts: ValidParts, report: Report) -> None:
    loads = [name for _, name in parts.names("load")]
    fits = [contact.name for contact in parts.contacts.values() if contact.interference is not None]
    for index, contact in parts.contacts.items():
        if contact.interference is not None and contact.name in loads:
            message = f'a load is called "{contact.name}" too, which is ambiguous in stages'
            report.add(("contact", index, "name"), message)
    complete = not parts.count("load") and len(parts.contacts) == parts.count("contact")
    if not loads and not fits and complete and not report.has(("load",)):
        report.add(("load",), "no loads", "add [[load]], or interference in a contact")
    if "stage" not in parts.data:
        return
    names = [*loads, *fits]
    for index, stage in parts.stages.items():
        if not stage:
            report.add(("stage", index), "names no load", suggestion("", names, "loads"))
        for name in stage:
            if name not in names:
                hint = suggestion(name, names, "loads")
                report.add(("stage", index, name), f'there is no load "{name}"', hint)
    if len(parts.stages) == parts.count("stage"):
        moved = {name for stage in parts.stages.values() for name in stage}
        for index, name in parts.names("load"):
            if name not in moved:
                report.add(
                    ("load", index), "no stage applies this load", f"write {name} = 1.0 in a [[stage]]"
                )


def _check_stops(parts: ValidParts, report: Report) -> None:
    names = {section: [name for _, name in parts.names(section)] for section in ("load", "contact", "probe")}
    names["support"] = [name for _, name in parts.texts("support", "boundary")]
    # Invalid loads may be platens.
    names["rigid"] = [
        name
        for index, name in parts.names("load")
        if isinstance(parts.loads.get(index), Platen | ObstacleMotion | None)
    ]
    for index, stop in parts.stops.items():
        check_stop(stop, ("stop", index), names, report)
        smooth = [c.name for c in parts.contacts.values() if not c.friction]
        if stop.what == "slip" and stop.of in smooth:
            report.add(("stop", index, "of"), f'contact "{stop.of}" is frictionless and has no slip')
