"""Requirements of finite strain, and features not yet supported with it."""

from __future__ import annotations

from mlsanm_cli.case.checks.valid_parts import ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.case import Contact
from mlsanm_cli.case.model.loads import ObstacleMotion, Platen, Pressure
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import AnyObstacle, DiskObstacle
from mlsanm_cli.case.model.places import Place
from mlsanm_cli.case.report import Report

MAX_PLANE_STRAIN_NU = 4.0 / 9.0
"""Largest Poisson's ratio in plane strain without locking of the strong form: lambda = 8 mu."""
_UNSUPPORTED = "with finite strain is not supported yet"


def check_finite(parts: ValidParts, report: Report) -> None:
    """Adds a problem for every feature incompatible with the ``strain`` of the model."""
    if parts.model is None:
        return
    if parts.model.strain == "small":
        _check_small(parts, report)
        return
    for name, material in parts.case.material.items():
        _check_law(material, ("material", name), parts.model.plane, report)
    _check_loads(parts, parts.model.plane, report)
    _check_other_sections(parts, report)


def _check_small(parts: ValidParts, report: Report) -> None:
    hint = 'write strain = "finite" in [model], or remove the key'
    for name, material in parts.case.material.items():
        if material.law != "linear":
            message = f'"{material.law}" needs finite strain'
            report.add(("material", name, "law"), message, hint)
    for index, load in parts.loads.items():
        if isinstance(load, Pressure) and load.follows:
            report.add(("load", index, "follows"), "follower loads need finite strain", hint)
        if isinstance(load, ObstacleMotion) and load.rotation:
            report.add(("load", index, "rotation"), "an obstacle that turns needs finite strain", hint)


def _check_law(material: Material, path: KeyPath, plane: str, report: Report) -> None:
    if material.law == "linear":
        message = '"linear" elasticity is not valid at finite strain'
        report.add((*path, "law"), message, 'law = "saint-venant-kirchhoff" or "neo-hookean"')
        return
    if material.form != "isotropic":
        report.add((*path, "law"), f'"{material.law}" needs an isotropic material', "give E and nu")
        return
    if material.nu is None:
        return
    if plane == "strain" and material.nu > MAX_PLANE_STRAIN_NU:
        message = f"{material.nu:g}: a nearly incompressible material {_UNSUPPORTED}"
        report.add((*path, "nu"), message, f"at most {MAX_PLANE_STRAIN_NU:.3f} in plane strain")
    elif material.nu >= 0.5:
        report.add((*path, "nu"), f"{material.nu:g}: an incompressible material {_UNSUPPORTED}", "below 0.5")


def _check_loads(parts: ValidParts, plane: str, report: Report) -> None:
    ways: dict[tuple[Place, ...], set[str]] = {}
    for one in parts.loads.values():
        if isinstance(one, Platen):
            ways.setdefault(one.places, set()).update(one.control)
    for index, load in parts.loads.items():
        path: KeyPath = ("load", index)
        if isinstance(load, Pressure) and load.follows and plane == "stress":
            report.add(
                (*path, "follows"), f"a follower pressure in plane stress {_UNSUPPORTED}", "follows = false"
            )
        elif isinstance(load, Platen) and load.turning != "fixed" and len(ways[load.places]) < 2:
            # The direction in which a rotating plate would let its body slide rotates with it.
            message = "a plate that can rotate at finite strain needs a value in both directions"
            report.add(path, message, "give ux or fx, and uy or fy; a force of 0.0 for a free direction")


def _check_pivots(parts: ValidParts, report: Report) -> None:
    """Adds rotations of obstacles without a pivot, and different pivots of one obstacle."""
    obstacles = {one.name: one.obstacle for one in parts.contacts.values() if one.obstacle is not None}
    first: dict[str, tuple[float, float]] = {}
    for index, load in parts.loads.items():
        if not isinstance(load, ObstacleMotion) or load.obstacle not in obstacles:
            continue
        pivot = pivot_of(obstacles[load.obstacle], load)
        if load.rotation and pivot is None:
            report.add(("load", index, "rotation"), "needs a pivot", "give pivot")
        if load.rotation and pivot is not None and first.setdefault(load.obstacle, pivot) != pivot:
            message = "differs from that of another load on the same obstacle"
            report.add(("load", index, "pivot"), message, "one pivot for all")


def pivot_of(obstacle: AnyObstacle, load: ObstacleMotion) -> tuple[float, float] | None:
    """The point about which a load turns an obstacle, None if the case gives none."""
    center = obstacle.center if isinstance(obstacle, DiskObstacle) else None
    return load.pivot or center


def _check_contact(contact: Contact, path: KeyPath, report: Report) -> None:
    bodies = {split_boundary(name)[0] for name in contact.boundaries}
    if contact.obstacle is None and len(bodies) == 1:
        message = f"contact of a body with itself {_UNSUPPORTED}"
        report.add((*path, "master"), message, "another body's boundary")
    if contact.bonded:
        report.add((*path, "friction"), f"bonded surfaces {_UNSUPPORTED}", "a coefficient")
    if contact.gap:
        message = f"an additional gap {_UNSUPPORTED}"
        report.add((*path, "gap"), message, "include it in the shape or position of the body")
    if contact.interference is not None:
        report.add((*path, "interference"), f"an interference {_UNSUPPORTED}", "move the obstacle")
    if contact.regularization.law != "exact":
        message = f'the "{contact.regularization.law}" contact law {_UNSUPPORTED}'
        report.add((*path, "regularization", "law"), message, 'law = "exact"')
    # resolved.toml has all keys, so the default is allowed.
    if contact.reach != type(contact).model_fields["reach"].default:
        message = "does not apply at finite strain: all nodes of the slave are candidates"
        report.add((*path, "reach"), message, "remove it")


def _check_other_sections(parts: ValidParts, report: Report) -> None:
    _check_pivots(parts, report)
    for index, contact in parts.contacts.items():
        _check_contact(contact, ("contact", index), report)
    if "reference" in parts.data:
        report.add(("reference",), f"an analytical solution {_UNSUPPORTED}", "remove the table")
    if parts.case.mls.scheme != "least-squares":
        report.add(("mls", "scheme"), f'"{parts.case.mls.scheme}" {_UNSUPPORTED}', '"least-squares"')
    if parts.case.mls.degree == 1:
        report.add(("mls", "degree"), f"degree {parts.case.mls.degree} {_UNSUPPORTED}", "at least 2")
    if parts.case.adapt.passes:
        report.add(("adapt", "passes"), f"refinement {_UNSUPPORTED}", "write 0")
    solver = parts.case.solver
    if solver.method == "active-set" and not parts.count("contact"):
        report.add(("solver", "method"), '"active-set" needs a contact', '"anm" or "newton"')
