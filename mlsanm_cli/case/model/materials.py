"""Materials: their constants, laws, and the conditions of a positive definite stiffness. A further
hyperelastic law is an entry of ``law``, its keys, and a row of ``HYPERELASTIC``."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field

from mlsanm_cli.case.model.section import (
    ANGLE,
    EXPANSION,
    NUMBER,
    STRESS,
    Positive,
    Scope,
    Section,
    Unit,
    expecting,
)
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.toml import toml_value

Triple = tuple[float, float, float]
Pair = tuple[float, float]
Stiffness = Annotated[
    tuple[Triple, Triple, Triple],
    expecting("expected three rows of three numbers, in the order xx, yy, xy"),
    STRESS,
]
Expansion = Annotated[float | Triple, expecting("expected a number, or a list of three"), EXPANSION]
Hardening = Annotated[
    tuple[Pair, ...],
    Field(min_length=1),
    expecting("expected rows of two numbers, plastic strain and flow stress"),
]
Ludwik = Annotated[
    Pair, expecting("expected two numbers, strength and exponent"), Unit("stress, dimensionless")
]
MAX_TERMS = 6
"""Terms of Ogden's law that may be given."""
Terms = Annotated[
    tuple[float, ...], Field(min_length=1, max_length=MAX_TERMS), expecting("expected a list of numbers")
]
Form = Literal["isotropic", "orthotropic", "stiffness"]

OUT_OF_PLANE = ("E3", "nu13", "nu23")
"""Constants of an orthotropic material that plane strain requires too."""
FORMS: dict[Form, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "stiffness": (("stiffness",), ()),
    "orthotropic": (("E1", "E2", "G12", "nu12"), (*OUT_OF_PLANE, "angle")),
    "isotropic": (("E", "nu"), ()),
}
"""Required and optional keys of each form of a material. One of them selects the form."""
CHOICES = "; or ".join(", ".join(required) for required, _ in reversed(FORMS.values()))
KIRCHHOFF = "saint-venant-kirchhoff"
"""The law of finite strain with the constants of linear elasticity, in any form."""
HYPERELASTIC: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "neo-hookean": (("E", "nu"), ()),
    "mooney-rivlin": (("c10", "c01", "nu"), ()),
    "yeoh": (("c10", "c20", "c30", "nu"), ()),
    "arruda-boyce": (("mu", "locking_stretch", "nu"), ()),
    "blatz-ko": (("E", "nu"), ("f",)),
    "ogden": (("shear_moduli", "exponents", "nu"), ()),
}
"""Required and optional keys of the other laws of finite strain."""
LOCKING = (KIRCHHOFF, "blatz-ko")
"""Laws of finite strain without the formulation for nearly incompressible materials."""
MAX_NU = 0.4999
"""Largest Poisson's ratio at finite strain: the bulk modulus is then 5,000 times the shear modulus."""
PLASTIC = ("yield_stress", "hardening", "hardening_table", "ludwik", "kinematic_hardening")
"""Keys of plasticity, of which the first selects it."""
MAX_PLANE_STRAIN_NU = 4.0 / 9.0
"""Largest Poisson's ratio in plane strain without locking of the strong form: lambda = 8 mu."""


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
    stiffness: Stiffness | None = None
    """Matrix from strains xx, yy, 2xy to stresses xx, yy, xy; symmetric and positive definite."""
    alpha: Expansion | None = None
    """Coefficient of thermal expansion; for orthotropic materials also [a1, a2, a3] along the axes; with
    `stiffness` the strains [xx, yy, 2xy] per degree of a body that is free in the plane."""

    c10: Annotated[float, STRESS] | None = None
    """Constant of the first invariant (`mooney-rivlin`, `yeoh`)."""
    c01: Annotated[float, STRESS] | None = None
    """Constant of the second invariant; c10 + c01, half the shear modulus, is positive."""
    c20: Annotated[float, STRESS] | None = None
    """Constant of the square of the first invariant (`yeoh`)."""
    c30: Annotated[float, STRESS] | None = None
    """Constant of its cube (`yeoh`)."""
    mu: Annotated[Positive, STRESS] | None = None
    """Modulus of the chains (`arruda-boyce`)."""
    locking_stretch: Annotated[float, Field(gt=1.0), NUMBER] | None = None
    """Stretch at which the chains are straight (`arruda-boyce`)."""
    shear_moduli: Annotated[Terms, STRESS] | None = None
    """Moduli m of `ogden`, W = sum m/a (l1^a + l2^a + l3^a - 3); half the sum of m a is the shear modulus."""
    exponents: Annotated[Terms, NUMBER] | None = None
    """Exponents a of `ogden`, one for each modulus, of the same sign."""
    f: Annotated[float, Field(ge=0.0, le=1.0), NUMBER] | None = None
    """Part of the first invariant of `blatz-ko`; 0, a foam, by default."""

    yield_stress: Annotated[Positive, STRESS] | None = None
    """Stress in uniaxial tension at which an isotropic material begins to yield (von Mises); without one it
    is elastic. Small strain only."""
    hardening: Annotated[float, Field(ge=0.0), STRESS] | None = None
    """Slope of the flow stress over the plastic strain (isotropic hardening); 0, perfect plasticity, by
    default."""
    hardening_table: Hardening | None = None
    """Rows [plastic strain, flow stress] of uniaxial tension, increasing, after [0, yield_stress]; linear
    between them, constant beyond."""
    ludwik: Ludwik | None = None
    """Strength K and exponent n, 0 < n <= 1, of Ludwik's flow stress yield_stress + K a^n with the plastic
    strain a."""
    kinematic_hardening: Annotated[float, Field(ge=0.0), STRESS] | None = None
    """Slope of the stress over the plastic strain by kinematic hardening (Prager), alone or in addition to
    isotropic hardening; 0 by default."""

    law: Literal[
        "linear",
        "saint-venant-kirchhoff",
        "neo-hookean",
        "mooney-rivlin",
        "yeoh",
        "ogden",
        "arruda-boyce",
        "blatz-ko",
    ] = "linear"
    """Linear elasticity for small strains. For finite strains Saint Venant-Kirchhoff (large rotations,
    moderate strains), with the constants of linear elasticity; or laws of rubber and foams, with nu of the
    undeformed state: compressible neo-Hookean and Blatz-Ko (E), Mooney-Rivlin (c10, c01), Yeoh (c10, c20,
    c30), Ogden (shear_moduli, exponents), Arruda-Boyce (mu, locking_stretch)."""

    @property
    def form(self) -> Form:
        """The form to which the keys belong; isotropic if there are none."""
        given = {key for key in type(self).model_fields if getattr(self, key) is not None}
        return next((form for form, keys in FORMS.items() if given & {*keys[0], *keys[1]}), "isotropic")

    @property
    def elastic(self) -> bool:
        """Whether the constants are those of linear elasticity."""
        return self.law not in HYPERELASTIC

    @property
    def flows(self) -> bool:
        return self.yield_stress is not None

    @property
    def constants(self) -> dict[str, Any]:
        """The given constants of a hyperelastic law."""
        required, optional = HYPERELASTIC[self.law]
        given = {key: getattr(self, key) for key in (*required, *optional)}
        return {key: value for key, value in given.items() if value is not None}

    def faults(self, scope: Scope) -> Iterator[Fault]:
        form, confined = self.form, scope.confined
        if not self.elastic and form != "isotropic":
            hint = f"give {' and '.join(HYPERELASTIC[self.law][0])}"
            yield Fault(("law",), f'"{self.law}" needs an isotropic material', hint)
            return
        required, optional = FORMS[form] if self.elastic else HYPERELASTIC[self.law]
        for key in self.model_fields_set.difference(required, optional, PLASTIC, ("alpha", "law")):
            hint = CHOICES if self.elastic else ""
            yield Fault((key,), f"cannot be combined with {', '.join(required)}", hint)
        # Constants of the third axis of an orthotropic material that the model needs, and why.
        needed: dict[str, str] = {}
        if form == "orthotropic" and confined:
            needed = dict.fromkeys(OUT_OF_PLANE, "required in plane strain")
        elif form == "orthotropic" and self.law == KIRCHHOFF:
            needed = dict.fromkeys(OUT_OF_PLANE[1:], "required for the thickness at finite strain")
        missing = [key for key in (*required, *needed) if getattr(self, key) is None]
        for key in missing:
            hint = f'"{self.law}" has the constants {", ".join(required)}'
            if not self.model_fields_set:
                hint = CHOICES
            elif self.elastic:
                hint = needed.get(key, "")
            yield Fault((key,), "missing (required)", hint)
        if not missing:
            yield from self._constant_faults(confined)
        yield from self._law_faults(scope)
        if any(getattr(self, key) is not None for key in PLASTIC):
            yield from self._plastic_faults(scope)
        listed = isinstance(self.alpha, tuple)
        if listed and form == "isotropic":
            yield Fault(("alpha",), "an isotropic material has a single coefficient")
        elif form == "stiffness" and self.alpha is not None and confined and not listed:
            message = "with a plane stiffness the effect of out-of-plane expansion is unknown"
            yield Fault(("alpha",), message, "give the plane strains per degree, [xx, yy, 2xy]")

    def _constant_faults(self, confined: bool) -> Iterator[Fault]:
        if self.stiffness is not None:
            c = self.stiffness
            largest = max(abs(value) for row in c for value in row)
            if any(abs(c[i][j] - c[j][i]) > ROUND_OFF * largest for i, j in ((0, 1), (0, 2), (1, 2))):
                hint = "rows and columns are xx, yy, xy; the last strain is 2 e_xy"
                yield Fault(("stiffness",), "is not symmetric", hint)
            elif not _positive(c):
                yield Fault(("stiffness",), "is not positive definite")
        elif self.form == "orthotropic":
            yield from self._compliance_faults()
        elif confined and self.nu == 0.5:
            message = "an incompressible material (0.5) has no finite stiffness in plane strain"
            yield Fault(("nu",), message, "use a value below 0.5, or plane stress")
        if self.law == "mooney-rivlin" and (self.c10 or 0.0) + (self.c01 or 0.0) <= 0.0:
            yield Fault(("c10",), "c10 + c01, half the shear modulus, is not positive")
        if self.law == "yeoh" and (self.c10 or 0.0) <= 0.0:
            yield Fault(("c10",), "half the shear modulus, is not positive")
        if self.shear_moduli is not None and self.exponents is not None:
            if len(self.shear_moduli) != len(self.exponents):
                message = f"{len(self.exponents)} for {len(self.shear_moduli)} moduli"
                yield Fault(("exponents",), message, "give one for each of shear_moduli")
            elif min(m * a for m, a in zip(self.shear_moduli, self.exponents, strict=True)) <= 0.0:
                message = "has a modulus whose sign is not that of its exponent"
                yield Fault(("shear_moduli",), message, "their products must be positive")

    def _compliance_faults(self) -> Iterator[Fault]:
        """The compliance must be positive definite (Lempriere 1968, doi:10.2514/3.4974)."""
        moduli = (self.E1, self.E2, self.E3)
        unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        sound = True
        for i, j in ((0, 1), (0, 2), (1, 2)):
            key = f"nu{i + 1}{j + 1}"
            first, second, nu = moduli[i], moduli[j], getattr(self, key)
            if first is None or second is None or nu is None:
                continue
            limit = math.sqrt(first / second)
            unit[i][j] = unit[j][i] = -nu / limit
            if not abs(nu) < limit:
                sound = False
                root = f"the square root of E{i + 1}/E{j + 1}"
                yield Fault((key,), f"{nu:g} is not between -{limit:g} and {limit:g}, {root}")
        if sound and not _positive(unit):
            message = "nu12, nu13 and nu23 together give a stiffness that is not positive definite"
            yield Fault(("nu12",), message, "reduce them")

    def _law_faults(self, scope: Scope) -> Iterator[Fault]:
        finite = self.law == KIRCHHOFF or not self.elastic
        yield from scope.finite_only(finite, ("law",), f'"{self.law}"')
        if scope.strain != "finite":
            return
        if not finite:
            hint = f"law = {' or '.join(map(toml_value, (KIRCHHOFF, *HYPERELASTIC)))}"
            yield Fault(("law",), f'"{self.law}" elasticity is not valid at finite strain', hint)
        elif self.form == "stiffness" and not scope.confined:
            hint = "give the constants of an orthotropic material, with nu13 and nu23"
            yield Fault(("stiffness",), "leaves the thickness at finite strain unknown in plane stress", hint)
        elif self.nu is not None:
            locks = scope.confined and self.law in LOCKING
            limit = MAX_PLANE_STRAIN_NU if locks else MAX_NU
            hint = f"at most {limit:.4g}{', or a law of rubber, such as neo-hookean' if locks else ''}"
            what = f"{self.nu:g}: an incompressible material"
            yield from scope.refused(self.nu > limit, ("nu",), what, hint)

    def _plastic_faults(self, scope: Scope) -> Iterator[Fault]:
        first = next(key for key in PLASTIC if getattr(self, key) is not None)
        key, case, what = (first,), scope.case, "plasticity with"
        if not self.flows:
            yield Fault(("yield_stress",), "missing (required)", f"{first} needs a yield stress")
        if self.form != "isotropic":
            yield Fault(key, "needs an isotropic material", "give E and nu")
        elif not self.elastic:
            yield Fault(key, f'cannot be combined with law = "{self.law}"', 'law = "linear"')
        else:
            yield from scope.refused(True, key, "plasticity", 'write strain = "small" in [model]')
            if case.is_regularized:
                hint = 'law = "exact" in [contact.regularization], solver.method = "auto"'
                yield Fault(key, f"{what} the hyperbolic contact law or its methods is not supported", hint)
            if case.mls.degree == 1:
                yield Fault(key, f"{what} mls.degree = 1 is not supported", 'degree = "auto", which is 2')
            if case.reference is not None:
                yield Fault(key, f"{what} an analytical solution of elastic bodies", "remove [reference]")
        yield from self.exclusive("hardening", "hardening_table", "ludwik", required=False)
        if self.ludwik is not None and not (self.ludwik[0] >= 0.0 and 0.0 < self.ludwik[1] <= 1.0):
            hint = "K is at least 0, n above 0 and at most 1"
            yield Fault(("ludwik",), "does not harden at a falling rate", hint)
        rows = ((0.0, self.yield_stress or 0.0), *(self.hardening_table or ()))
        hint = "strains increase, stresses do not decrease: softening has no unique solution"
        for number, (before, after) in enumerate(pairwise(rows)):
            repeats_start = number == 0 and after == before
            if not repeats_start and (after[0] <= before[0] or after[1] < before[1]):
                message = f"[{after[0]:g}, {after[1]:g}] follows [{before[0]:g}, {before[1]:g}]"
                yield Fault(("hardening_table", number), message, hint)


def _positive(c: Sequence[Sequence[float]]) -> bool:
    """Whether a symmetric (3, 3) matrix, scaled to a unit diagonal, is positive definite by its minors."""
    if not all(c[i][i] > 0.0 for i in range(3)):
        return False
    xy, xz, yz = (c[i][j] / math.sqrt(c[i][i] * c[j][j]) for i, j in ((0, 1), (0, 2), (1, 2)))
    determinant = 1.0 + 2.0 * xy * xz * yz - xy**2 - xz**2 - yz**2
    return 1.0 - xy**2 > FINE_ROUND_OFF and determinant > FINE_ROUND_OFF
