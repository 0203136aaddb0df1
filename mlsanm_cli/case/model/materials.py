"""Materials: isotropic, orthotropic or given by a plane stiffness, with checks of admissibility."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import ANGLE, EXPANSION, NUMBER, STRESS, Positive, Section, expecting
from mlsanm_cli.case.report import Report
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

Triple = tuple[float, float, float]
Form = Literal["isotropic", "orthotropic", "stiffness"]

FORMS: dict[Form, tuple[str, ...]] = {
    "isotropic": ("E", "nu"),
    "orthotropic": ("E1", "E2", "G12", "nu12"),
    "stiffness": ("stiffness",),
}
"""Keys required by each form of a material."""
OUT_OF_PLANE = ("E3", "nu13", "nu23")
"""Additional keys required by an orthotropic material in plane strain."""


class Material(Section):
    """An elastic material: isotropic (E, nu), orthotropic (E1, E2, G12, nu12; in plane strain also E3, nu13,
    nu23), or given by its plane ``stiffness``."""

    E: Annotated[Positive, STRESS] | None = None
    """Young's modulus."""
    nu: Annotated[float, Field(gt=-1.0, le=0.5), NUMBER] | None = None
    """Poisson's ratio; below 0.5 in plane strain."""
    E1: Annotated[Positive, STRESS] | None = None
    """Young's modulus along the first axis of an orthotropic material."""
    E2: Annotated[Positive, STRESS] | None = None
    """Young's modulus along the second axis."""
    E3: Annotated[Positive, STRESS] | None = None
    """Out-of-plane Young's modulus; required in plane strain."""
    G12: Annotated[Positive, STRESS] | None = None
    """In-plane shear modulus."""
    nu12: Annotated[float, NUMBER] | None = None
    """Poisson's ratio: contraction along axis 2 under tension along axis 1; nu12/E1 = nu21/E2."""
    nu13: Annotated[float, NUMBER] | None = None
    """Out-of-plane contraction under tension along axis 1; required in plane strain."""
    nu23: Annotated[float, NUMBER] | None = None
    """Out-of-plane contraction under tension along axis 2; required in plane strain."""
    angle: Annotated[float, ANGLE] | None = None
    """Angle from the x axis to axis 1, counter-clockwise; 0 by default."""
    stiffness: (
        Annotated[
            tuple[Triple, Triple, Triple],
            expecting("expected three rows of three numbers, in the order xx, yy, xy"),
            STRESS,
        ]
        | None
    ) = None
    """Matrix from strains xx, yy, 2xy to stresses xx, yy, xy; symmetric and positive definite."""
    alpha: Annotated[float | Triple, expecting("expected a number, or a list of three"), EXPANSION] | None = (
        None
    )
    """Coefficient of thermal expansion; for orthotropic materials also [a1, a2, a3] along the axes; with
    `stiffness` the strains [xx, yy, 2xy] per degree of a body that is free in the plane."""

    law: Literal["linear", "saint-venant-kirchhoff", "neo-hookean"] = "linear"
    """Linear elasticity for small strains; Saint Venant-Kirchhoff (large rotations, moderate strains) or
    compressible neo-Hookean (large strains) for finite strains, with E and nu of the undeformed state."""

    @property
    def form(self) -> Form:
        """The form to which the keys belong; isotropic if there are none."""
        if self.stiffness is not None:
            return "stiffness"
        given = [getattr(self, key) for key in (*FORMS["orthotropic"], *OUT_OF_PLANE, "angle")]
        return "orthotropic" if any(value is not None for value in given) else "isotropic"


def check_material(material: Material, path: KeyPath, plane: str | None, report: Report) -> None:
    """Adds missing and contradictory keys, and stiffnesses that are not positive definite in ``plane``."""
    form = material.form
    allowed = {*FORMS[form], "alpha", "law", *((*OUT_OF_PLANE, "angle") if form == "orthotropic" else ())}
    for key in material.model_fields_set - allowed:
        message = f"cannot be combined with {', '.join(FORMS[form])}"
        report.add((*path, key), message, "E, nu; or E1, E2, G12, nu12; or stiffness")
    needed = [*FORMS[form], *(OUT_OF_PLANE if form == "orthotropic" and plane == "strain" else ())]
    missing = [key for key in needed if getattr(material, key) is None]
    for key in missing:
        hint = {
            "isotropic": "" if material.model_fields_set else "E, nu; or E1, E2, G12, nu12; or stiffness",
            "orthotropic": "required in plane strain" if key in OUT_OF_PLANE else "",
            "stiffness": "",
        }[form]
        report.add((*path, key), "missing (required)", hint)
    if missing:
        pass
    elif form == "orthotropic":
        _check_orthotropic(material, path, report)
    elif form == "stiffness":
        _check_stiffness(material, path, report)
    elif plane == "strain" and material.nu == 0.5:
        message = "an incompressible material (0.5) has no finite stiffness in plane strain"
        report.add((*path, "nu"), message, "use a value below 0.5, or plane stress")
    _check_expansion(material, path, plane, report)


def _check_orthotropic(material: Material, path: KeyPath, report: Report) -> None:
    """Checks that the compliance is positive definite (Lempriere 1968, doi:10.2514/3.4974)."""
    moduli = [material.E1, material.E2, material.E3]
    sound = True
    for key, first, second in (("nu12", 0, 1), ("nu13", 0, 2), ("nu23", 1, 2)):
        one, other, value = moduli[first], moduli[second], getattr(material, key)
        if one is None or other is None or value is None:
            continue
        limit = math.sqrt(one / other)
        if not abs(value) < limit:
            sound = False
            message = f"{value:g} is not between -{limit:g} and {limit:g}, the square root of "
            report.add((*path, key), f"{message}E{first + 1}/E{second + 1}")
    third = [getattr(material, key) for key in OUT_OF_PLANE]
    if sound and None not in third:
        cross = [
            -getattr(material, f"nu{i}{j}")
            * math.sqrt(getattr(material, f"E{j}") / getattr(material, f"E{i}"))
            for i, j in ((1, 2), (1, 3), (2, 3))
        ]
        unit = [[1.0, cross[0], cross[1]], [cross[0], 1.0, cross[2]], [cross[1], cross[2], 1.0]]
        if not _determinant(unit) > FINE_ROUND_OFF:
            message = "nu12, nu13 and nu23 together give a stiffness that is not positive definite"
            report.add((*path, "nu12"), message, "reduce them")


def _check_stiffness(material: Material, path: KeyPath, report: Report) -> None:
    assert material.stiffness is not None
    c, here = material.stiffness, (*path, "stiffness")
    largest = max(abs(value) for row in c for value in row)
    if any(abs(c[i][j] - c[j][i]) > ROUND_OFF * largest for i, j in ((0, 1), (0, 2), (1, 2))):
        report.add(here, "is not symmetric", "rows and columns are xx, yy, xy; the last strain is 2 e_xy")
    elif not _positive(c):
        report.add(here, "is not positive definite")


def _positive(c: Sequence[Sequence[float]]) -> bool:
    if not all(c[i][i] > 0.0 for i in range(3)):
        return False
    root = [math.sqrt(c[i][i]) for i in range(3)]
    unit = [[c[i][j] / (root[i] * root[j]) for j in range(3)] for i in range(3)]
    return 1.0 - unit[0][1] ** 2 > FINE_ROUND_OFF and _determinant(unit) > FINE_ROUND_OFF


def _determinant(m: Sequence[Sequence[float]]) -> float:
    return (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )


def _check_expansion(material: Material, path: KeyPath, plane: str | None, report: Report) -> None:
    listed = isinstance(material.alpha, tuple)
    if listed and material.form == "isotropic":
        report.add((*path, "alpha"), "an isotropic material has a single coefficient")
    elif material.form == "stiffness" and material.alpha is not None and plane == "strain" and not listed:
        message = "with a plane stiffness the effect of out-of-plane expansion is unknown"
        report.add((*path, "alpha"), message, "give the plane strains per degree, [xx, yy, 2xy]")
