"""Checks of relations in a case: names and references, values that depend on each other.

Overlapping conditions are in `conditions`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from mlsanm_cli.case.checks.conditions import check_conditions
from mlsanm_cli.case.checks.finite import check_finite
from mlsanm_cli.case.checks.load_checks import check_ends, check_loads
from mlsanm_cli.case.checks.sound import Sound
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import BOUNDARY_PATTERN, split_boundary
from mlsanm_cli.case.model.case import Body, Contact
from mlsanm_cli.case.model.files import Geometry, GeometryInspector, Points
from mlsanm_cli.case.model.loads import ObstacleMotion, Platen
from mlsanm_cli.case.model.materials import check_material
from mlsanm_cli.case.model.obstacles import check_obstacle
from mlsanm_cli.case.model.shapes import shape_faults
from mlsanm_cli.case.model.stop import check_stop
from mlsanm_cli.case.report import Report, suggestion
from mlsanm_cli.errors import GeometryError, OutlineError

ROUND_OFF = 1e-9
"""Smallest spacing, relative to the largest coordinate."""
HOLDING = ("model", "body", "support", "load", "contact")
"""Sections that decide whether a body can move freely."""
MOST_NEIGHBORS = 20
LOWEST_AUTO = 2
"""The lowest degree that "auto" takes."""
"""Largest number of nodes of a stencil per coefficient of the polynomial."""


def run_checks(sound: Sound, inspect_geometry_file: GeometryInspector | None, report: Report) -> Sound:
    """Adds every conflict between the sound parts of the case; returns these with the
    geometries of their shapes. Without a ``inspect_geometry_file`` nothing is checked that depends on
    these."""
    sound = replace(sound, geometries=_geometries(sound, inspect_geometry_file, report))
    _check_names(sound, report)
    _check_materials(sound, report)
    _check_references(sound, report)
    for index, body in sound.bodies.items():
        _check_spacing(body, index, report)
        if index in sound.geometries:
            _check_body(body, sound.geometries[index], index, report)
    check_loads(sound, report)
    _check_contacts(sound, report)
    _check_stages(sound, report)
    _check_stops(sound, report)
    _check_numerics(sound, report)
    check_conditions(sound, report)
    check_finite(sound, report)
    # A fault in a support would otherwise be reported twice.
    if inspect_geometry_file is not None and not any(report.touches((section,)) for section in HOLDING):
        for fault in inspect_geometry_file.floating(sound.case):
            report.add(fault.key, fault.message, fault.hint)
    return sound


def _geometries(
    sound: Sound, inspect_geometry_file: GeometryInspector | None, report: Report
) -> dict[int, Geometry]:
    if not sound.count("body") and not report.has(("body",)):
        report.add(("body",), "the list is empty, at least one item is required", "add [[body]]")
    found: dict[int, Geometry] = {}
    for index, body in sound.bodies.items():
        path: KeyPath = ("body", index, "shape")
        faults = tuple(shape_faults(body.shape))
        if not faults and inspect_geometry_file is not None and not report.touches(path):
            try:
                found[index] = inspect_geometry_file.geometry(body.shape)
            except OutlineError as error:
                faults = error.faults
            except GeometryError as error:
                report.add((*path, "file"), error.message, error.hint)
        for fault in faults:
            report.add((*path, *fault.key), fault.message, fault.hint)
    return found


def _check_names(sound: Sound, report: Report) -> None:
    for section in ("body", "load", "contact", "probe"):
        first: dict[str, int] = {}
        for index, name in sound.names(section):
            if name in first:
                report.add((section, index, "name"), f'another {section} is called "{name}" already')
            first.setdefault(name, index)


def _check_materials(sound: Sound, report: Report) -> None:
    table = sound.data.get("material")
    defined = [name for name in table if isinstance(name, str)] if isinstance(table, dict) else []
    used = sound.texts("body", "material")
    for index, name in used:
        if name not in defined:
            hint = suggestion(name, defined, "materials")
            report.add(("body", index, "material"), f'there is no material "{name}"', hint)
    for name in defined:
        if name not in [other for _, other in used]:
            hint = f'remove it, or write material = "{name}" in a body'
            report.add(("material", name), "no body uses this material", hint)
    plane = sound.model.plane if sound.model else None
    for name, material in sound.case.material.items():
        check_material(material, ("material", name), plane, report)


def _check_spacing(body: Body, index: int, report: Report) -> None:
    """Bodies with nodes from a file have no spacing of their own."""
    path: KeyPath = ("body", index)
    if not body.has_nodes:
        return
    where = 'the nodes are those of the file (use = "outline" places new ones)'
    if isinstance(body.shape, Points):
        where = "the nodes are those of the file"
    for key, given in (("spacing", body.spacing != "auto"), ("refine", body.refine), ("seed", body.seed)):
        if given:
            report.add((*path, key), f"does not apply: {where}", "remove it")


def _check_body(body: Body, shape: Geometry, index: int, report: Report) -> None:
    path: KeyPath = ("body", index)
    if body.has_nodes:
        return
    far = max(abs(shape.centre[0]), abs(shape.centre[1])) + shape.size
    given = body.spacing if isinstance(body.spacing, float) else None
    spacings = [] if given is None else [((*path, "spacing"), given)]
    spacings += [((*path, "refine", n, "spacing"), refine.spacing) for n, refine in enumerate(body.refine)]
    for key, spacing in spacings:
        if spacing < ROUND_OFF * far:
            message = f"{spacing:g} is below round-off for coordinates up to {far:g}"
            report.add(key, message, f"at least {ROUND_OFF * far:.2g}")
    if given is not None and given > shape.size > 0.0:
        report.add((*path, "spacing"), f"{given:g} is larger than the body ({shape.size:g})")
    for place, refine in enumerate(body.refine):
        here: KeyPath = (*path, "refine", place)
        if (refine.at is None) == (refine.along is None):
            report.add(here, 'needs exactly one of "at" (a point) and "along" (a boundary)')
        if refine.along is not None and refine.edge(body.name) not in shape.normals:
            hint = suggestion(refine.edge(body.name), shape.normals, "boundaries")
            report.add((*here, "along"), f'body "{body.name}" has no boundary "{refine.along}"', hint)
        if given is not None and refine.spacing > given:
            message = f"{refine.spacing:g} is larger than the body's spacing {given:g}"
            report.add((*here, "spacing"), message, "a refinement can only reduce it")


def _check_references(sound: Sound, report: Report) -> None:
    """Names of bodies and boundaries, also in items with other faults."""
    names = [known for _, known in sound.names("body")]
    for section in ("support", "load", "probe"):
        for index, name in sound.texts(section, "body"):
            if name not in names:
                hint = suggestion(name, names, "bodies")
                report.add((section, index, "body"), f'there is no body "{name}"', hint)
    for section, key in (
        ("support", "boundary"),
        ("load", "boundary"),
        ("contact", "slave"),
        ("contact", "master"),
    ):
        for path, boundary in sound.boundaries(section, key):
            if BOUNDARY_PATTERN.fullmatch(boundary):
                _check_boundary(sound, report, path, boundary)


def _check_boundary(sound: Sound, report: Report, path: KeyPath, boundary: str) -> None:
    name, edge = split_boundary(boundary)
    names = [known for _, known in sound.names("body")]
    if name not in names:
        near = suggestion(name, names, "bodies")
        report.add(path, f'"{boundary}": there is no body "{name}"', near)
        return
    edges = sound.edges(name)
    if edges and edge not in edges:
        options = [f"{name}.{valid}" for valid in edges]
        hint = suggestion(boundary, options, "boundaries")
        report.add(path, f'body "{name}" has no boundary "{edge}"', hint)


def _check_contacts(sound: Sound, report: Report) -> None:
    pairs: dict[tuple[frozenset[str], object], str] = {}
    for index, contact in sound.contacts.items():
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
    """Keys that do not apply to bonded surfaces."""
    plain = Contact(name=contact.name, slave=contact.slave, master=contact.master)
    for key in ("interference", "gap", "reach", "regularization"):
        if getattr(contact, key) != getattr(plain, key):
            report.add((*path, key), "does not apply to bonded surfaces", "remove it")


def _check_stages(sound: Sound, report: Report) -> None:
    loads = [name for _, name in sound.names("load")]
    fits = [contact.name for contact in sound.contacts.values() if contact.interference is not None]
    for index, contact in sound.contacts.items():
        if contact.interference is not None and contact.name in loads:
            message = f'a load is called "{contact.name}" too, which is ambiguous in stages'
            report.add(("contact", index, "name"), message)
    complete = not sound.count("load") and len(sound.contacts) == sound.count("contact")
    if not loads and not fits and complete and not report.has(("load",)):
        report.add(("load",), "no loads", "add [[load]], or interference in a contact")
    if "stage" not in sound.data:
        return
    names = [*loads, *fits]
    for index, stage in sound.stages.items():
        if not stage:
            report.add(("stage", index), "names no load", suggestion("", names, "loads"))
        for name in stage:
            if name not in names:
                hint = suggestion(name, names, "loads")
                report.add(("stage", index, name), f'there is no load "{name}"', hint)
    if len(sound.stages) == sound.count("stage"):
        moved = {name for stage in sound.stages.values() for name in stage}
        for index, name in sound.names("load"):
            if name not in moved:
                report.add(
                    ("load", index), "no stage applies this load", f"write {name} = 1.0 in a [[stage]]"
                )


def _check_stops(sound: Sound, report: Report) -> None:
    names = {section: [name for _, name in sound.names(section)] for section in ("load", "contact", "probe")}
    names["support"] = [name for _, name in sound.texts("support", "boundary")]
    # Loads with faults may be platens.
    rigid = (Platen, ObstacleMotion)
    names["mover"] = [
        name
        for index, name in sound.names("load")
        if isinstance(sound.loads.get(index), (*rigid, type(None)))
    ]
    for index, stop in sound.stops.items():
        check_stop(stop, ("stop", index), names, report)
        smooth = [c.name for c in sound.contacts.values() if not c.friction]
        if stop.what == "slip" and stop.of in smooth:
            report.add(("stop", index, "of"), f'contact "{stop.of}" is frictionless and has no slip')


def _check_numerics(sound: Sound, report: Report) -> None:
    case = sound.case
    if case.mls.neighbors != "auto":
        degree = case.mls.degree if case.mls.degree != "auto" else LOWEST_AUTO
        terms = (degree + 1) * (degree + 2) // 2
        path: KeyPath = ("mls", "neighbors")
        of = f"the {terms} terms of degree {degree}"
        if case.mls.neighbors < terms:
            hint = f'at least {terms}, better twice as many, or "auto"'
            report.add(path, f"{case.mls.neighbors} nodes are too few for {of}", hint)
        elif case.mls.neighbors > MOST_NEIGHBORS * terms:
            hint = f'at most {MOST_NEIGHBORS * terms}, or "auto"'
            report.add(path, f"{case.mls.neighbors} nodes are too many for {of}", hint)
    _check_laws(sound, report, [one for one in case.contact if not one.bonded])
    if case.adapt.passes:
        fixed = [body.name for body in case.body if body.has_nodes]
        if fixed:
            message = f'body "{fixed[0]}" cannot be refined: its nodes are those of its file'
            report.add(("adapt", "passes"), message, 'write 0, or take the outline only: use = "outline"')
        if case.contact and not case.touching:
            hint = "write 0, and refine along the bonds and at their ends with [[body.refine]]"
            report.add(("adapt", "passes"), "bonded contacts are not refined automatically", hint)
    for field, times in Counter(case.output.fields).items():
        if times > 1:
            report.add(("output", "fields"), f'"{field}" is listed {times} times')
    stages = sound.count("stage") if "stage" in sound.data else 1
    for index, position in enumerate(case.output.at):
        if not 0.0 <= position <= stages:
            message = f"{position:g} is outside the path, which goes from 0 to {stages}"
            report.add(("output", "at", index), message, "a position is the stage index + fraction")


def _check_laws(sound: Sound, report: Report, contacts: Iterable[Contact]) -> None:
    laws = {contact.name: contact.regularization.law for contact in contacts}
    first = next(iter(laws.values()), None)
    for index, contact in sound.contacts.items():
        if not contact.bonded and contact.regularization.law != first:
            message = f'"{contact.regularization.law}" here, "{first}" in another contact'
            hint = "use one law in all contacts; mixed laws are not supported yet"
            report.add(("contact", index, "regularization", "law"), message, hint)
    _check_friction_laws(sound, report)
    if first is None and "contact" in sound.incomplete:
        return
    solver = sound.case.solver
    if solver.polish is True and first != "hyperbolic":
        why = "the exact contact law needs none" if first else "there is no [[contact]]"
        report.add(("solver", "polish"), f"nothing to polish: {why}", "remove it, or set it to false")
    fitting = {"anm": "hyperbolic", "newton": "hyperbolic", "active-set": "exact"}.get(solver.method, first)
    if first not in (None, fitting):
        message = f'"{solver.method}" cannot solve the {first} contact law'
        hint = f'law = "{fitting}" in [contact.regularization], or method = "auto"'
        report.add(("solver", "method"), message, hint)
    if solver.formulation == "monolithic":
        _check_monolithic(sound, first, report)


def _check_monolithic(sound: Sound, law: str | None, report: Report) -> None:
    contacts = sound.case.contact
    tied = [c.name for c in contacts if c.bonded]
    rigid = [c.name for c in contacts if c.obstacle is not None or c.interference is not None]
    hint = 'formulation = "condensed"'
    if law is None:
        report.add(("solver", "formulation"), "there is no contact to solve together with the bodies", hint)
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


def _check_friction_laws(sound: Sound, report: Report) -> None:
    frictional = {
        index: contact for index, contact in sound.contacts.items() if contact.friction and not contact.bonded
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
