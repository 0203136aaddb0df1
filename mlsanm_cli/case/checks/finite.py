"""Finite strain: what it asks of a case, and what it cannot do yet, which is refused by name."""

from __future__ import annotations

from collections.abc import Mapping

from mlsanm_cli.case.checks.draft import Draft
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.case import Contact
from mlsanm_cli.case.model.loads import Platen, Pressure, Temperature
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.report import Report

LARGEST_NU = 4.0 / 9.0
"""Poisson's ratio in plane strain up to which equilibrium by second derivatives does not lock: lambda is
8 mu there."""
_ALONE = "with finite strain is not supported yet"
_SMALL = 'use strain = "small" in [model], or leave it out'


def check_finite(draft: Draft, report: Report) -> None:
    """Adds what does not go together with the ``strain`` of the model."""
    if draft.model is None:
        return
    if draft.model.strain == "small":
        _check_small(draft, report)
        return
    for name, material in draft.materials.items():
        _check_law(material, ("material", name), draft.model.plane, report)
    _check_loads(draft, draft.model.plane, report)
    _check_rest(draft, report)


def _check_small(draft: Draft, report: Report) -> None:
    hint = 'write strain = "finite" in [model], or remove the key'
    for name, material in draft.materials.items():
        if material.law != "linear":
            message = f'"{material.law}" is a law of finite strain; the model has small strains'
            report.add(("material", name, "law"), message, hint)
    for index, load in draft.loads.items():
        if isinstance(load, Pressure) and load.follows:
            report.add(("load", index, "follows"), "loads follow at finite strain only", hint)


def _check_law(material: Material, path: KeyPath, plane: str, report: Report) -> None:
    if material.law == "linear":
        message = '"linear" elasticity is for small strains; the model has finite ones'
        report.add((*path, "law"), message, 'law = "saint-venant-kirchhoff" or "neo-hookean"')
        return
    if material.form != "isotropic":
        report.add((*path, "law"), f'"{material.law}" is an isotropic law', "give E and nu")
        return
    if material.nu is None:
        return
    if plane == "strain" and material.nu > LARGEST_NU:
        message = f"{material.nu:g}: a nearly incompressible material {_ALONE}"
        report.add((*path, "nu"), message, f"at most {LARGEST_NU:.3f} in plane strain")
    elif material.nu >= 0.5:
        report.add((*path, "nu"), f"{material.nu:g}: an incompressible material {_ALONE}", "below 0.5")


def _check_loads(draft: Draft, plane: str, report: Report) -> None:
    for index, support in draft.supports.items():
        if support.spring is not None:
            report.add(("support", index, "spring"), f"a spring {_ALONE}", _SMALL)
    for index, load in draft.loads.items():
        path: KeyPath = ("load", index)
        if isinstance(load, Temperature):
            report.add((*path, "temperature"), f"a change of temperature {_ALONE}", _SMALL)
        elif isinstance(load, Pressure) and load.follows and plane == "stress":
            report.add(
                (*path, "follows"), f"a following pressure in plane stress {_ALONE}", "follows = false"
            )
        elif isinstance(load, Platen):
            if any(control == "force" for control, _ in load.control.values()):
                hint = "move it by a displacement, or load the boundary with a traction"
                report.add(path, f"a platen moved by a force {_ALONE}", hint)
            # A turn by any angle is no multiple of a small one.
            if load.turning != "fixed":
                report.add((*path, "rotation"), f"a platen that turns {_ALONE}", 'rotation = "fixed"')


def _check_contact(contact: Contact, path: KeyPath, report: Report) -> None:
    if contact.obstacle is None:
        _check_master(contact, path, report)
    if not isinstance(contact.slave, str):
        report.add((*path, "slave"), f"a side of several boundaries {_ALONE}", "one boundary")
    if contact.bonded:
        report.add((*path, "friction"), f"bonded surfaces {_ALONE}", "a coefficient")
    if contact.gap:
        report.add((*path, "gap"), f"a gap beside that of the surfaces {_ALONE}", "draw it")
    if contact.interference is not None:
        report.add((*path, "interference"), f"an interference {_ALONE}", "move the obstacle")
    if contact.regularization.law != "exact":
        message = f'the "{contact.regularization.law}" contact law {_ALONE}'
        report.add((*path, "regularization", "law"), message, 'law = "exact"')
    for key in ("accuracy", "reach"):
        if key in contact.model_fields_set:
            message = "has no meaning at finite strain: any node of the slave may touch"
            report.add((*path, key), message, "remove it")


def _check_master(contact: Contact, path: KeyPath, report: Report) -> None:
    if contact.master is not None and not isinstance(contact.master, str):
        report.add((*path, "master"), f"a side of several boundaries {_ALONE}", "one boundary")
    bodies = {split_boundary(name)[0] for name in contact.boundaries}
    if len(bodies) == 1:
        report.add((*path, "master"), f"contact of a body with itself {_ALONE}", "another body's boundary")


def _check_rest(draft: Draft, report: Report) -> None:
    for index, contact in draft.contacts.items():
        _check_contact(contact, ("contact", index), report)
    if "reference" in draft.data:
        report.add(("reference",), f"a closed formula {_ALONE}", "remove the table")
    if draft.mls is not None:
        if draft.mls.scheme != "least-squares":
            report.add(("mls", "scheme"), f'"{draft.mls.scheme}" {_ALONE}', '"least-squares"')
        if draft.mls.degree < 2:
            report.add(("mls", "degree"), f"degree {draft.mls.degree} {_ALONE}", "at least 2")
    if draft.adapt is not None and draft.adapt.passes:
        report.add(("adapt", "passes"), f"refinement {_ALONE}", "write 0")
    solver = draft.solver
    given = draft.data.get("solver")
    if solver is None or not isinstance(given, Mapping):
        return
    if solver.method == "active-set" and not draft.count("contact"):
        report.add(("solver", "method"), '"active-set" is for contact', '"anm" or "newton"')
    if solver.linear in ("pardiso", "mumps"):
        report.add(("solver", "linear"), f'"{solver.linear}" {_ALONE}', '"auto"')
