"""Checks of materials, shapes and spacings."""

from __future__ import annotations

from mlsanm_cli.case.checks.valid_parts import Geometry, GeometryInspector, ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.case import Body
from mlsanm_cli.case.model.materials import check_material
from mlsanm_cli.case.model.shapes import Points, shape_faults
from mlsanm_cli.case.report import Report, suggestion
from mlsanm_cli.errors import GeometryError, OutlineError

MIN_RELATIVE_SPACING = 1e-9
"""Smallest spacing, relative to the largest coordinate: coordinates must resolve it."""


def geometries_of(
    parts: ValidParts, inspector: GeometryInspector | None, report: Report
) -> dict[int, Geometry]:
    if not parts.count("body") and not report.has(("body",)):
        report.add(("body",), "the list is empty, at least one item is required", "add [[body]]")
    found: dict[int, Geometry] = {}
    for index, body in parts.bodies.items():
        path: KeyPath = ("body", index, "shape")
        faults = tuple(shape_faults(body.shape))
        if not faults and inspector is not None and not report.touches(path):
            try:
                found[index] = inspector.geometry(body.shape)
            except OutlineError as error:
                faults = error.faults
            except GeometryError as error:
                report.add((*path, "file"), error.message, error.hint)
        for fault in faults:
            report.add((*path, *fault.key), fault.message, fault.hint)
    return found


def check_materials(parts: ValidParts, report: Report) -> None:
    table = parts.data.get("material")
    defined = [name for name in table if isinstance(name, str)] if isinstance(table, dict) else []
    used = parts.texts("body", "material")
    for index, name in used:
        if name not in defined:
            hint = suggestion(name, defined, "materials")
            report.add(("body", index, "material"), f'there is no material "{name}"', hint)
    for name in defined:
        if name not in [other for _, other in used]:
            hint = f'remove it, or write material = "{name}" in a body'
            report.add(("material", name), "no body uses this material", hint)
    plane = parts.model.plane if parts.model else None
    for name, material in parts.case.material.items():
        check_material(material, ("material", name), plane, report)


def check_spacing(body: Body, index: int, report: Report) -> None:
    """Adds keys of the spacing that a body with nodes from a file cannot have."""
    path: KeyPath = ("body", index)
    if not body.has_nodes:
        return
    where = 'the nodes are those of the file (use = "outline" places new ones)'
    if isinstance(body.shape, Points):
        where = "the nodes are those of the file"
    for key, given in (("spacing", body.spacing != "auto"), ("refine", body.refine), ("seed", body.seed)):
        if given:
            report.add((*path, key), f"does not apply: {where}", "remove it")


def check_body(body: Body, shape: Geometry, index: int, report: Report) -> None:
    path: KeyPath = ("body", index)
    if body.has_nodes:
        return
    far = max(abs(shape.centre[0]), abs(shape.centre[1])) + shape.size
    given = body.spacing if isinstance(body.spacing, float) else None
    spacings = [] if given is None else [((*path, "spacing"), given)]
    spacings += [((*path, "refine", n, "spacing"), refine.spacing) for n, refine in enumerate(body.refine)]
    for key, spacing in spacings:
        if spacing < MIN_RELATIVE_SPACING * far:
            message = f"{spacing:g} is below round-off for coordinates up to {far:g}"
            report.add(key, message, f"at least {MIN_RELATIVE_SPACING * far:.2g}")
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
