"""What bodies of revolution do not support."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from mlsanm_cli.case.model.motions import ObstacleMotion, Platen
from mlsanm_cli.case.model.section import Scope
from mlsanm_cli.case.report import KeyPath
from mlsanm_cli.errors import Fault
from mlsanm_cli.roundoff import ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.case.model.case import Case

HINT = 'write plane = "strain" for long bodies, or remove it'


def refused_of_revolution(case: Case, scope: Scope) -> Iterator[Fault]:
    """Faults of a ``case`` with bodies of revolution."""

    def refused(given: object, key: KeyPath, what: str, hint: str = HINT) -> Iterator[Fault]:
        if given:
            yield Fault(key, f'{what} with plane = "axisymmetric" is not supported yet', hint)

    yield from refused(
        case.model.strain == "finite", ("model", "strain"), "finite strain", 'strain = "small"'
    )
    yield from refused(case.reference, ("reference",), "an analytical solution", "remove the table")
    for number, body in enumerate(case.body):
        shape = scope.geometries.get(body.name)
        if shape is not None and shape.left < -ROUND_OFF * shape.size:
            message = f"extends to x = {shape.left:g}, beyond the axis of revolution"
            yield Fault(("body", number, "shape"), message, "draw the half with x >= 0")
    for name, material in case.material.items():
        hint = "give the constants of an isotropic or orthotropic material"
        key = ("material", name)
        yield from refused(material.stiffness, (*key, "stiffness"), "a plane stiffness", hint)
        yield from refused(material.flows, (*key, "yield_stress"), "plasticity", "leave yield_stress out")
        yield from refused(material.angle, (*key, "angle"), "a turned orthotropic material", "angle = 0.0")
        yield from refused(material.yield_stress, (*key, "yield_stress"), "plasticity")
    for number, support in enumerate(case.support):
        hint = "give boundary, and from and to for a part of it"
        yield from refused(support.near, ("support", number, "near"), "a support of a point", hint)
    for number, load in enumerate(case.load):
        if isinstance(load, Platen | ObstacleMotion) and (
            "x" in load.control or load.rotation not in (0.0, "fixed")
        ):
            message = "rigid bodies of revolution move along the axis only"
            yield Fault(("load", number), message, "give uy or fy")
    for number, contact in enumerate(case.contact):
        law = ("contact", number, "regularization", "law")
        yield from refused(contact.regularization.law != "exact", law, "the regularised law", 'law = "exact"')
