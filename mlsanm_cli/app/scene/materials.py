"""Plane elasticity and laws of the materials of a case."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mlsanm_cli.case import Case, Material
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics.laws.law import Law, SaintVenantKirchhoff, law_class
from mlsanm_cli.mechanics.laws.von_mises import Hardening, VonMises
from mlsanm_cli.mechanics.material import PlaneMaterial, anisotropic, isotropic, orthotropic


def materials(case: Case) -> dict[str, PlaneMaterial]:
    """Elasticity of every material at small strain."""
    revolved = case.model.revolved
    plane = "strain" if revolved else case.model.plane
    found = {
        name: _in_plane(material, plane) if material.elastic else _hyperelastic(material, plane).linear
        for name, material in case.material.items()
    }
    return {name: one.of_revolution for name, one in found.items()} if revolved else found


def flow_laws(case: Case) -> dict[str, VonMises]:
    """The law of every body whose material flows."""
    found = {}
    for body in case.body:
        material = case.material[body.material]
        if material.yield_stress is None:
            continue
        rows = [row for row in material.hardening_table or () if row[0] > 0.0]
        strength, exponent = material.ludwik or (0.0, 1.0)
        hardening = Hardening(
            np.array([(0.0, material.yield_stress), *rows]),
            material.hardening or 0.0,
            strength,
            exponent,
            material.kinematic_hardening or 0.0,
        )
        found[body.name] = VonMises(_in_plane(material, case.model.plane), case.model.plane, hardening)
    return found


def laws_of(case: Case) -> dict[str, Law]:
    """The law of every body at finite strain. Raises CaseError for an anisotropic material that is nearly
    incompressible."""
    plane, found = case.model.plane, dict[str, Law]()
    for body in case.body:
        material = case.material[body.material]
        if material.law == SaintVenantKirchhoff.name:
            found[body.name] = SaintVenantKirchhoff(_in_plane(material, plane), plane)
            if found[body.name].linear.nearly_incompressible:
                message = f'"{material.law}" cannot represent a nearly incompressible material'
                hint = "give constants of a more compressible material, or a law of rubber"
                raise CaseError((CaseProblem(f"material.{body.material}.law", message, hint=hint),))
        else:
            found[body.name] = _hyperelastic(material, plane)
    return found


def _hyperelastic(material: Material, plane: str) -> Law:
    """A law whose constants are keys of the case."""
    assert not isinstance(material.alpha, tuple)
    law: Law = law_class(material.law)(plane=plane, alpha=material.alpha or 0.0, **material.constants)
    return law


def _in_plane(material: Material, plane: str) -> PlaneMaterial:
    alpha = material.alpha or 0.0
    expansion = alpha if isinstance(alpha, tuple) else (alpha, alpha, alpha)
    if material.stiffness is not None:
        along = alpha if isinstance(alpha, tuple) else (alpha, alpha, 0.0)
        return anisotropic(np.array(material.stiffness), plane, along)
    if material.form == "isotropic":
        assert material.E is not None
        assert material.nu is not None
        return replace(isotropic(material.E, material.nu, plane, expansion[0]), flows=material.flows)
    assert material.G12 is not None
    return orthotropic(
        _known(material.E1, material.E2, material.E3),
        _known(material.nu12, material.nu13, material.nu23),
        material.G12,
        math.radians(material.angle or 0.0),
        plane,
        expansion,
    )


def _known(*values: float | None) -> list[float]:
    """Values with None, of the third axis in plane stress, replaced by nan."""
    return [math.nan if value is None else value for value in values]
