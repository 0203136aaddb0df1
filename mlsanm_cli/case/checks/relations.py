"""Checks of what a case means: names and references, values that depend on each other.

Overlapping conditions are in `conditions`, bodies that can drift in `drift`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from mlsanm_cli.case.checks.conditions import check_conditions
from mlsanm_cli.case.checks.draft import Draft
from mlsanm_cli.case.checks.drift import check_drift
from mlsanm_cli.case.checks.finite import check_finite
from mlsanm_cli.case.checks.load_checks import check_ends, check_loads
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import BOUNDARY_PATTERN, split_boundary
from mlsanm_cli.case.model.case import Body, Contact
from mlsanm_cli.case.model.files import Geometry, Points
from mlsanm_cli.case.model.loads import ObstacleMotion, Platen
from mlsanm_cli.case.model.materials import check_material
from mlsanm_cli.case.model.obstacles import check_obstacle
from mlsanm_cli.case.model.outline import OutlineShape
from mlsanm_cli.case.model.polygon import Polygon
from mlsanm_cli.case.model.polygons import check_outline, check_polygon
from mlsanm_cli.case.model.round_shapes import Annulus, Sector
from mlsanm_cli.case.model.shapes import AnyShape, Rectangle
from mlsanm_cli.case.model.stop import check_stop
from mlsanm_cli.case.report import Report, suggestion

ROUND_OFF = 1e-9
"""Smallest spacing, in parts of the largest coordinate."""
MOST_NEIGHBORS = 20
"""Most nodes of a stencil, in coefficients of the polynomial."""


def run_checks(draft: Draft, report: Report) -> None:
    """Adds every problem that the sound parts of the case have with each other."""
    _check_names(draft, report)
    _check_materials(draft, report)
    _check_references(draft, report)
    for index, shape in draft.shapes.items():
        _check_shape(shape, ("body", index, "shape"), report)
    for index, body in draft.bodies.items():
        _check_spacing(body, index, report)
        if index in draft.geometries:
            _check_body(body, draft.geometries[index], index, report)
    check_loads(draft, report)
    _check_contacts(draft, report)
    _check_stages(draft, report)
    _check_stops(draft, report)
    _check_numerics(draft, report)
    check_conditions(draft, report)
    check_drift(draft, report)
    check_finite(draft, report)


def _check_names(draft: Draft, report: Report) -> None:
    for section in ("body", "load", "contact", "probe"):
        first: dict[str, int] = {}
        for index, name in draft.names(section):
            if name in first:
                report.add((section, index, "name"), f'"{name}" is the name of another {section} already')
            first.setdefault(name, index)


def _check_materials(draft: Draft, report: Report) -> None:
    table = draft.data.get("material")
    defined = [name for name in table if isinstance(name, str)] if isinstance(table, dict) else []
    used = draft.texts("body", "material")
    for index, name in used:
        if name not in defined:
            hint = suggestion(name, defined, "materials")
            report.add(("body", index, "material"), f'there is no material "{name}"', hint)
    for name in defined:
        if name not in [other for _, other in used]:
            report.add(("material", name), "no body uses this material", _use_hint(name))
    plane = draft.model.plane if draft.model else None
    for name, material in draft.materials.items():
        check_material(material, ("material", name), plane, report)


def _use_hint(name: str) -> str:
    return f'remove it, or write material = "{name}" in a body'


def _check_shape(shape: AnyShape, path: KeyPath, report: Report) -> None:
    if isinstance(shape, Rectangle):
        for axis, (low, high) in (("x", shape.x), ("y", shape.y)):
            if not low < high:
                report.add((*path, axis), f"[{low:g}, {high:g}] is no range", "the smaller number first")
    if isinstance(shape, Sector | Annulus) and not 0.0 < shape.radii[0] < shape.radii[1]:
        report.add((*path, "radii"), "must be the inner and the outer radius, both above 0")
    if isinstance(shape, Sector) and not 0.0 < shape.angles[1] - shape.angles[0] < 360.0:
        report.add((*path, "angles"), "must rise by less than 360 degrees", "as in [0.0, 90.0]")
    if isinstance(shape, Polygon):
        check_polygon(shape, path, report)
    if isinstance(shape, OutlineShape):
        check_outline(shape, path, report)


def _check_spacing(body: Body, index: int, report: Report) -> None:
    """Who places the nodes needs a spacing; who brings them has one."""
    path: KeyPath = ("body", index)
    if not body.has_nodes:
        return
    where = 'the nodes are those of the file; use = "outline" would place others'
    if isinstance(body.shape, Points):
        where = "the nodes are those of the file"
    for key, given in (("spacing", body.spacing != "auto"), ("refine", body.refine), ("seed", body.seed)):
        if given:
            report.add((*path, key), f"has no meaning here: {where}", "remove it")


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
            message = f"{spacing:g} is lost in round-off at places up to {far:g} from the origin"
            report.add(key, message, f"at least {ROUND_OFF * far:.2g}")
    if given is not None and given > shape.size > 0.0:
        report.add((*path, "spacing"), f"{given:g} is larger than the body itself ({shape.size:g})")
    for place, refine in enumerate(body.refine):
        here: KeyPath = (*path, "refine", place)
        if (refine.at is None) == (refine.along is None):
            report.add(here, 'needs exactly one of "at" (a point) and "along" (a boundary)')
        if refine.along is not None and refine.edge(body.name) not in shape.boundaries:
            hint = suggestion(refine.edge(body.name), shape.boundaries, "boundaries")
            report.add((*here, "along"), f'body "{body.name}" has no boundary "{refine.along}"', hint)
        if given is not None and refine.spacing > given:
            message = f"{refine.spacing:g} is larger than the body's spacing {given:g}"
            report.add((*here, "spacing"), message, "a refinement can only make it smaller")


def _check_references(draft: Draft, report: Report) -> None:
    """Names of bodies and boundaries, also in items with other faults."""
    names = [known for _, known in draft.names("body")]
    for section in ("support", "load", "probe"):
        for index, name in draft.texts(section, "body"):
            if name not in names:
                hint = suggestion(name, names, "bodies")
                report.add((section, index, "body"), f'there is no body "{name}"', hint)
    for section, key in (
        ("support", "boundary"),
        ("load", "boundary"),
        ("contact", "slave"),
        ("contact", "master"),
    ):
        for path, boundary in draft.boundaries(section, key):
            if BOUNDARY_PATTERN.fullmatch(boundary):
                _check_boundary(draft, report, path, boundary)


def _check_boundary(draft: Draft, report: Report, path: KeyPath, boundary: str) -> None:
    name, edge = split_boundary(boundary)
    names = [known for _, known in draft.names("body")]
    if name not in names:
        near = suggestion(name, names, "bodies")
        report.add(path, f'"{boundary}": there is no body "{name}"', near)
        return
    shape = draft.geometry(name)
    if shape is not None and edge not in shape.boundaries:
        options = [f"{name}.{valid}" for valid in shape.boundaries]
        hint = suggestion(boundary, options, "boundaries")
        report.add(
            path, f'{"an" if shape.kind[0] in "ao" else "a"} {shape.kind} has no boundary "{edge}"', hint
        )


def _check_contacts(draft: Draft, report: Report) -> None:
    pairs: dict[tuple[frozenset[str], object], str] = {}
    for index, contact in draft.contacts.items():
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
                hint = "hold the boundary with a [[support]], or move it with a platen"
                report.add((*path, "friction"), "nothing is bonded to a rigid obstacle", hint)
            continue
        both = set(contact.sides[0].boundaries) & set(contact.sides[1].boundaries)
        if both:
            single = len(contact.boundaries) == 2
            message = (
                "slave and master are the same boundary" if single else f"{both.pop()} is in the slave too"
            )
            report.add((*path, "master"), message)
            continue
        bodies = {split_boundary(boundary)[0] for boundary in contact.boundaries}
        if len(bodies) == 1:
            message = f"body {bodies.pop()} touching itself is not supported yet"
            report.add(path, message, "slave and master on two bodies")
        if contact.bonded:
            _check_bond(contact, path, report)
        pair = frozenset(contact.boundaries), contact.ends
        if pair in pairs:
            report.add(path, f'the same two boundaries as contact "{pairs[pair]}"')
        pairs.setdefault(pair, contact.name)


def _check_bond(contact: Contact, path: KeyPath, report: Report) -> None:
    """Keys that say nothing of surfaces that are one."""
    plain = Contact(name=contact.name, slave=contact.slave, master=contact.master)
    for key in ("interference", "gap", "reach", "regularization"):
        if getattr(contact, key) != getattr(plain, key):
            report.add((*path, key), "has no meaning here: the surfaces are bonded as drawn", "remove it")


def _check_stages(draft: Draft, report: Report) -> None:
    loads = [name for _, name in draft.names("load")]
    fits = [contact.name for contact in draft.contacts.values() if contact.interference is not None]
    for index, contact in draft.contacts.items():
        if contact.interference is not None and contact.name in loads:
            message = f'"{contact.name}" is the name of a load too; a stage could not tell them apart'
            report.add(("contact", index, "name"), message)
    if not loads and not fits and not draft.count("load") and len(draft.contacts) == draft.count("contact"):
        report.add(("load",), "nothing acts on the bodies", "add [[load]], or interference in a contact")
    if "stage" not in draft.data:
        return
    names = [*loads, *fits]
    for index, stage in draft.stages.items():
        if not stage:
            report.add(("stage", index), "moves no load", suggestion("", names, "loads"))
        for name in stage:
            if name not in names:
                hint = suggestion(name, names, "loads")
                report.add(("stage", index, name), f'there is no load "{name}"', hint)
    if len(draft.stages) == draft.count("stage"):
        moved = {name for stage in draft.stages.values() for name in stage}
        for index, name in draft.names("load"):
            if name not in moved:
                report.add(("load", index), "no stage moves this load", f"write {name} = 1.0 in a [[stage]]")


def _check_stops(draft: Draft, report: Report) -> None:
    names = {section: [name for _, name in draft.names(section)] for section in ("load", "contact", "probe")}
    names["support"] = [name for _, name in draft.texts("support", "boundary")]
    # Loads that are not sound may be platens.
    rigid = (Platen, ObstacleMotion)
    names["mover"] = [
        name
        for index, name in draft.names("load")
        if isinstance(draft.loads.get(index), (*rigid, type(None)))
    ]
    for index, stop in draft.stops.items():
        check_stop(stop, ("stop", index), names, report)
        smooth = [c.name for c in draft.contacts.values() if not c.friction]
        if stop.what == "slip" and stop.of in smooth:
            report.add(("stop", index, "of"), f'contact "{stop.of}" has no friction and so no slip')


def _check_numerics(draft: Draft, report: Report) -> None:
    mls = draft.mls
    if mls is not None and mls.neighbors != "auto":
        terms = (mls.degree + 1) * (mls.degree + 2) // 2
        if mls.neighbors < terms:
            message = f"{mls.neighbors} nodes cannot carry the {terms} terms of degree {mls.degree}"
            report.add(("mls", "neighbors"), message, f'at least {terms}, better twice as many, or "auto"')
        elif mls.neighbors > MOST_NEIGHBORS * terms:
            message = f"{mls.neighbors} nodes are far too many for the {terms} terms of degree {mls.degree}"
            report.add(("mls", "neighbors"), message, f'at most {MOST_NEIGHBORS * terms}, or "auto"')
    _check_laws(draft, report, [one for one in draft.contacts.values() if not one.bonded])
    fixed = [body.name for body in draft.bodies.values() if body.has_nodes]
    if draft.adapt is not None and draft.adapt.passes and fixed:
        message = f'body "{fixed[0]}" cannot be refined: its nodes are those of its file'
        report.add(("adapt", "passes"), message, 'write 0, or take the outline only: use = "outline"')
    contacts = draft.contacts.values()
    if draft.adapt is not None and draft.adapt.passes and contacts and all(one.bonded for one in contacts):
        hint = "write 0, and refine along the bonds, above all where they end, with [[body.refine]]"
        report.add(("adapt", "passes"), "refinement by passes does not know what bonds need", hint)
    if draft.output is None:
        return
    for field, times in Counter(draft.output.fields).items():
        if times > 1:
            report.add(("output", "fields"), f'"{field}" is listed {times} times')
    stages = draft.count("stage") if "stage" in draft.data else 1
    for index, position in enumerate(draft.output.at):
        if not 0.0 <= position <= stages:
            message = f"{position:g} is outside the path, which goes from 0 to {stages}"
            report.add(("output", "at", index), message, "a position is the stage index + fraction")


def _check_laws(draft: Draft, report: Report, contacts: Iterable[Contact]) -> None:
    laws = {contact.name: contact.regularization.law for contact in contacts}
    first = next(iter(laws.values()), None)
    for index, contact in draft.contacts.items():
        if not contact.bonded and contact.regularization.law != first:
            message = f'"{contact.regularization.law}" here and "{first}" in another contact'
            hint = "one law in all contacts; mixed laws are not supported yet"
            report.add(("contact", index, "regularization", "law"), message, hint)
    _check_friction_laws(draft, report)
    if draft.solver and draft.solver.polish is True and first != "hyperbolic":
        why = "the exact contact law needs none" if first else "there is no [[contact]]"
        report.add(("solver", "polish"), f"nothing to polish: {why}", "remove it, or set it to false")
    method = draft.solver.method if draft.solver else "auto"
    fitting = {"anm": "hyperbolic", "newton": "hyperbolic", "active-set": "exact"}
    if method in fitting and first is not None and first != fitting[method]:
        message = f'"{method}" cannot follow the {first} contact law'
        hint = f'law = "{fitting[method]}" in [contact.regularization], or method = "auto"'
        report.add(("solver", "method"), message, hint)
    if draft.solver and draft.solver.formulation == "monolithic" and first != "hyperbolic":
        if first is None:
            message, hint = "there is no contact to be solved together with the bodies", "remove the key"
        else:
            message = "the exact contact law is solved on the condensed system only"
            hint = 'law = "hyperbolic" in [contact.regularization], or formulation = "condensed"'
        report.add(("solver", "formulation"), message, hint)
    tied = [c.name for c in draft.contacts.values() if c.bonded]
    if draft.solver and draft.solver.formulation == "monolithic" and tied:
        message = f"the bond of contact {tied[0]} is known to the condensed system only"
        report.add(("solver", "formulation"), message, 'formulation = "condensed"')
    rigid = [c.name for c in draft.contacts.values() if c.obstacle is not None or c.interference is not None]
    if draft.solver and draft.solver.formulation == "monolithic" and rigid:
        message = f"the obstacle or interference of contact {rigid[0]} is known to the condensed system only"
        report.add(("solver", "formulation"), message, 'formulation = "condensed"')


def _check_friction_laws(draft: Draft, report: Report) -> None:
    rough = {
        index: contact for index, contact in draft.contacts.items() if contact.friction and not contact.bonded
    }
    first = next(iter(rough.values()), None)
    for index, contact in rough.items():
        here, path = contact.regularization, ("contact", index, "regularization", "friction_law")
        if first is not None and here.friction_law != first.regularization.friction_law:
            message = (
                f'"{here.friction_law}" here and "{first.regularization.friction_law}" in another contact'
            )
            report.add(path, message, "one friction law in all contacts")
        if here.friction_law == "holonomic" and here.law == "exact":
            report.add(
                path, "the exact contact law remembers", 'law = "hyperbolic", or friction_law = "memory"'
            )
