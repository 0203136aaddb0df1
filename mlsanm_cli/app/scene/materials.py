"""Plane elasticity of the materials of a case."""

from __future__ import annotations

import math

import numpy as np

from mlsanm_cli.case import Case, Material
from mlsanm_cli.mechanics.material import PlaneMaterial, anisotropic, isotropic, orthotropic


def materials(case: Case) -> dict[str, PlaneMaterial]:
    """Plane elasticity of every material."""
    return {name: _in_plane(material, case.model.plane) for name, material in case.material.items()}


def _in_plane(material: Material, plane: str) -> PlaneMaterial:
    alpha = material.alpha or 0.0
    if material.stiffness is not None:
        expansion = alpha if isinstance(alpha, tuple) else (alpha, alpha, 0.0)
        return anisotropic(np.array(material.stiffness), plane, expansion)
    if material.form == "isotropic":
        assert material.E is not None
        assert material.nu is not None
        assert isinstance(alpha, float)
        return isotropic(material.E, material.nu, plane, alpha)
    assert material.G12 is not None
    return orthotropic(
        _known(material.E1, material.E2, material.E3),
        _known(material.nu12, material.nu13, material.nu23),
        material.G12,
        math.radians(material.angle or 0.0),
        plane,
        alpha if isinstance(alpha, tuple) else (alpha, alpha, alpha),
    )


def _known(*values: float | None) -> list[float]:
    """Values with None, of the third axis in plane stress, replaced by nan."""
    return [math.nan if value is None else value for value in values]
