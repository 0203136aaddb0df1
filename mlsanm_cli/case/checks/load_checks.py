"""Checks of single loads and supports."""

from __future__ import annotations

from mlsanm_cli.case.checks.valid_parts import ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.loads import Displacement, ObstacleMotion, Platen, Pressure, Temperature, Traction
from mlsanm_cli.case.model.places import BoundaryPart
from mlsanm_cli.case.report import Report, suggestion


def check_loads(parts: ValidParts, report: Report) -> None:
    """Adds missing, duplicate and contradictory values of loads and supports."""
    for index in parts.supports:
        _check_support(parts, report, index)
    for index, load in parts.loads.items():
        path: KeyPath = ("load", index)
        if isinstance(load, BoundaryPart):
            check_ends(load, path, report)
        if isinstance(load, Platen | ObstacleMotion):
            _check_moving(parts, load, path, report)
            if isinstance(load, Platen):
                _check_turning(load, path, report)
        elif isinstance(load, Traction | Pressure):
            _check_value(load, path, report)
        elif isinstance(load, Displacement):
            _check_displacement(load, path, report)
        elif isinstance(load, Temperature):
            _check_temperature(parts, load, path, report)
    _check_obstacle_names(parts, report)


def check_ends(part: BoundaryPart, path: KeyPath, report: Report) -> None:
    """Adds a problem if only one end of a part is given, or if both are the same point."""
    if (part.start is None) != (part.to is None):
        key, other = ("from", "to") if part.to is None else ("to", "from")
        report.add((*path, key), f'needs "{other}" too', "give both ends of the part of the boundary")
    elif part.start is not None and part.start == part.to:
        report.add((*path, "to"), "is the same point", "give two different ends of the part of the boundary")


def _check_support(parts: ValidParts, report: Report, index: int) -> None:
    support, path = parts.supports[index], ("support", index)
    check_ends(support, path, report)
    if support.boundary is None and (support.start is not None or support.to is not None):
        report.add(path, '"from" and "to" need a boundary', 'give "boundary"')
    if support.boundary is not None and (support.body is not None or support.near is not None):
        report.add(path, 'give either "boundary", or "body" and "near"')
    elif support.boundary is None and (support.body is None or support.near is None):
        if support.body is None and support.near is None:
            report.add(path, "has no location", 'give "boundary", or "body" and "near"')
        else:
            report.add(
                path,
                '"body" and "near" are needed together',
                "near = [x, y] selects the nearest node of the body",
            )
    if support.spring is not None:
        here: KeyPath = (*path, "spring")
        if support.boundary is None:
            report.add(here, "springs act on a boundary", 'give "boundary"')
        if min(support.spring) < 0.0 or max(support.spring) == 0.0:
            report.add(
                here,
                "stiffnesses must not be negative, and one must be above 0",
                "0 for a direction without spring",
            )
    elif support.ux is None and support.uy is None:
        report.add(path, "fixes nothing", "give ux = 0.0, uy = 0.0 or both, or spring = [kx, ky]")
    for key in ("ux", "uy"):
        if getattr(support, key):
            message = "a nonzero displacement of a support is not supported yet"
            report.add((*path, key), message, 'a load of kind "displacement" moves a boundary')


def _check_value(load: Traction | Pressure, path: KeyPath, report: Report) -> None:
    value = load.traction if isinstance(load, Traction) else load.pressure
    if value is None and load.table is None:
        report.add((*path, load.kind), "missing (required)", f'give "{load.kind}" or "table"')
    elif value is not None and load.table is not None:
        report.add((*path, "table"), f'"{load.kind}" is given too', "give one of the two")


def _check_displacement(load: Displacement, path: KeyPath, report: Report) -> None:
    single = [key for key in ("ux", "uy") if getattr(load, key) is not None]
    if load.displacement is not None and single:
        message = '"displacement" gives both components already'
        report.add((*path, single[0]), message, "give displacement, or ux, or uy")
    elif load.displacement is None and not single:
        hint = "give displacement, or ux or uy alone"
        report.add((*path, "displacement"), "missing (required)", hint)


def _check_temperature(parts: ValidParts, load: Temperature, path: KeyPath, report: Report) -> None:
    body = next((body for body in parts.bodies.values() if body.name == load.body), None)
    material = parts.case.material.get(body.material) if body is not None else None
    if body is not None and material is not None and material.alpha is None:
        message = f'material "{body.material}" of body "{body.name}" has no thermal expansion'
        report.add(path, message, f"give alpha in [material.{body.material}]")


def _check_moving(parts: ValidParts, load: Platen | ObstacleMotion, path: KeyPath, report: Report) -> None:
    single = [key for key in ("ux", "uy", "fx", "fy") if getattr(load, key) is not None]
    if load.force is not None and load.displacement is not None:
        report.add(
            path, "has both force and displacement", "give one quantity per direction: ux or fx, uy or fy"
        )
    elif (load.force is not None or load.displacement is not None) and single:
        both = "force" if load.force is not None else "displacement"
        report.add(
            (*path, single[0]), f'"{both}" gives both components already', "ux or fx, and uy or fy instead"
        )
    elif not (load.control or _turns(parts, load)):
        what = "a platen" if isinstance(load, Platen) else "the motion of an obstacle"
        report.add(path, f"{what} needs a direction", "give force, displacement, or ux/uy/fx/fy")
    for u, f in (("ux", "fx"), ("uy", "fy")):
        if u in single and f in single:
            report.add((*path, f), f"{u} is given for this direction too", "give one of the two")


def _turns(parts: ValidParts, load: Platen | ObstacleMotion) -> bool:
    """Whether a load turns an obstacle, or is a moment on a plate whose directions other loads control."""
    if isinstance(load, ObstacleMotion):
        return load.rotation != 0.0
    plates = [one for one in parts.loads.values() if isinstance(one, Platen) and one.control]
    return load.moment is not None and load.label in [one.label for one in plates]


def _check_turning(load: Platen, path: KeyPath, report: Report) -> None:
    """Adds moments and hinges of plates that cannot rotate, and parts of plates on several bodies."""
    if load.moment is not None and load.turning != "free":
        hint = 'remove rotation, or write rotation = "free"'
        report.add((*path, "moment"), "a moment needs a plate that is free to rotate", hint)
    if load.hinge is not None and load.turning == "fixed":
        report.add((*path, "hinge"), "a hinge needs a plate that can rotate", 'rotation = "free"')
    if len(load.places) > 1 and load.ends is not None:
        report.add(
            (*path, "from"),
            "parts of boundaries of several bodies are not supported",
            "use one boundary, or whole boundaries",
        )


def _check_obstacle_names(parts: ValidParts, report: Report) -> None:
    """Adds loads of kind obstacle whose contact does not exist or has no obstacle."""
    names = [contact.name for contact in parts.contacts.values() if contact.obstacle is not None]
    known = [name for _, name in parts.names("contact")]
    for index, name in parts.texts("load", "obstacle"):
        if name not in known:
            hint = suggestion(name, names or known, "contacts with an obstacle")
            report.add(("load", index, "obstacle"), f'there is no contact "{name}"', hint)
        elif name in [contact.name for contact in parts.contacts.values()] and name not in names:
            message = f'contact "{name}" has a master and no obstacle'
            report.add(("load", index, "obstacle"), message, 'a load of kind "platen" moves a boundary')
