"""Finite strain: its requirements, and features that it does not support yet."""

from __future__ import annotations

from mlsanm_cli.case.checks.sound import Sound
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.case import Contact
from mlsanm_cli.case.model.loads import ObstacleMotion, Platen, Pressure
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import AnyObstacle, DiskObstacle
from mlsanm_cli.case.report import Report

LARGEST_NU = 4.0 / 9.0
"""Largest Poisson's ratio in plane strain without locking of the strong form: lambda = 8 mu."""
_ALONE = "with finite strain is not supported yet"


def check_finite(sound: Sound, report: Report) -> None:
    """Adds everything that is incompatible with the ``strain`` of the model."""
    if sound.model is None:
        return
    if sound.model.strain == "small":
        _check_small(sound, report)
        return
    for name, material in sound.case.material.items():
        _check_law(material, ("material", name), sound.model.plane, report)
    _check_loads(sound, sound.model.plane, report)
    _check_rest(sound, report)


def _check_small(sound: Sound, report: Report) -> None:
    hint = 'write strain = "finite" in [model], or remove the key'
    for name, material in sound.case.material.items():
        if material.law != "linear":
            message = f'"{material.law}" needs finite strain'
            report.add(("material", name, "law"), message, hint)
    for index, load in sound.loads.items():
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
    if plane == "strain" and material.nu > LARGEST_NU:
        message = f"{material.nu:g}: a nearly incompressible material {_ALONE}"
        report.add((*path, "nu"), message, f"at most {LARGEST_NU:.3f} in plane strain")
    elif material.nu >= 0.5:
        report.add((*path, "nu"), f"{material.nu:g}: an incompressible material {_ALONE}", "below 0.5")


def _check_loads(sound: Sound, plane: str, report: Report) -> None:
    for index, load in sound.loads.items():
        path: KeyPath = ("load", index)
        if isinstance(load, Pressure) and load.follows and plane == "stress":
            report.add((*path, "follows"), f"a follower pressure in plane stress {_ALONE}", "follows = false")
        elif isinstance(load, Platen) and load.turning != "fixed" and len(load.control) < 2:
            # Where a plate that turns lets its body slide along it is a matter of its turn.
            message = "a plate that turns at finite strain needs both directions"
            report.add(path, message, "give also ux or fx, and uy or fy; 0.0 for what is free of force")


def _check_pivots(sound: Sound, report: Report) -> None:
    """Obstacles other than disks turn about a point that is given; all loads on one have the same."""
    obstacles = {one.name: one.obstacle for one in sound.contacts.values() if one.obstacle is not None}
    first: dict[str, tuple[float, float]] = {}
    for index, load in sound.loads.items():
        if not isinstance(load, ObstacleMotion) or load.obstacle not in obstacles:
            continue
        pivot = pivot_of(obstacles[load.obstacle], load)
        if load.rotation and pivot is None:
            report.add(("load", index, "rotation"), "turns about no point", "give pivot")
        if load.rotation and pivot is not None and first.setdefault(load.obstacle, pivot) != pivot:
            message = "differs from that of another load on the same obstacle"
            report.add(("load", index, "pivot"), message, "one pivot for all")


def pivot_of(obstacle: AnyObstacle, load: ObstacleMotion) -> tuple[float, float] | None:
    """The point about which a load turns an obstacle, None where the case gives none."""
    center = obstacle.center if isinstance(obstacle, DiskObstacle) else None
    return load.pivot or center


def _check_contact(contact: Contact, path: KeyPath, report: Report) -> None:
    if contact.obstacle is None:
        _check_master(contact, path, report)
    if contact.bonded:
        report.add((*path, "friction"), f"bonded surfaces {_ALONE}", "a coefficient")
    if contact.gap:
        report.add((*path, "gap"), f"a gap in addition to that of the surfaces {_ALONE}", "draw it")
    if contact.interference is not None:
        report.add((*path, "interference"), f"an interference {_ALONE}", "move the obstacle")
    if contact.regularization.law != "exact":
        message = f'the "{contact.regularization.law}" contact law {_ALONE}'
        report.add((*path, "regularization", "law"), message, 'law = "exact"')
    # As resolved.toml has all keys, the default may be given.
    if contact.reach != type(contact).model_fields["reach"].default:
        message = "does not apply at finite strain: all nodes of the slave are candidates"
        report.add((*path, "reach"), message, "remove it")


def _check_master(contact: Contact, path: KeyPath, report: Report) -> None:
    bodies = {split_boundary(name)[0] for name in contact.boundaries}
    if len(bodies) == 1:
        report.add((*path, "master"), f"contact of a body with itself {_ALONE}", "another body's boundary")


def _check_rest(sound: Sound, report: Report) -> None:
    _check_pivots(sound, report)
    for index, contact in sound.contacts.items():
        _check_contact(contact, ("contact", index), report)
    if "reference" in sound.data:
        report.add(("reference",), f"an analytical solution {_ALONE}", "remove the table")
    if sound.case.mls.scheme != "least-squares":
        report.add(("mls", "scheme"), f'"{sound.case.mls.scheme}" {_ALONE}', '"least-squares"')
    if sound.case.mls.degree == 1:
        report.add(("mls", "degree"), f"degree {sound.case.mls.degree} {_ALONE}", "at least 2")
    if sound.case.adapt.passes:
        report.add(("adapt", "passes"), f"refinement {_ALONE}", "write 0")
    solver = sound.case.solver
    if solver.method == "active-set" and not sound.count("contact"):
        report.add(("solver", "method"), '"active-set" needs a contact', '"anm" or "newton"')
