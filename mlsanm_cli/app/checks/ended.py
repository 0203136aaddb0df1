"""Checks of a completed path at either strain."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.case import Case, finer_nodes
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.records import dataclass

BENDING_NODES = 5
"""Nodes across parts required for bending."""
NODE_FORCE_SHIFT = 2.0 * np.log(2.0) / np.pi
"""Increase of the work, over F^2/E', by the displacement of the node with half the spacing, without limit."""


@dataclass(frozen=True)
class EnergyErrors:
    """By body the relative difference of twice the strain energy and the work, the strain, the increase of
    the work at single nodes with half the spacing (``pointed``) and parts with too few nodes across
    (``thin``). ``deflection`` is the root mean square error of displacements that only energies show,
    ``name`` the limit of the differences, ``what`` the quantity compared with the work."""

    bodies: Mapping[str, float]
    strains: Mapping[str, float] = field(default_factory=dict)
    pointed: Mapping[str, float] = field(default_factory=dict)
    thin: Mapping[str, str] = field(default_factory=dict)
    deflection: float = 0.0
    name: str = "energy_error"
    what: str = "twice the strain energy of"


class Ended(Protocol):
    """A completed path at either strain, with the missing forces and works of its bodies."""

    @property
    def case(self) -> Case: ...
    @property
    def imbalance(self) -> Mapping[str, float]: ...
    @property
    def energies(self) -> EnergyErrors: ...


def worst_of(errors: Mapping[str, float]) -> str:
    """The body with the error largest in magnitude, or with nan."""
    return max(errors, key=lambda name: np.nan_to_num(abs(errors[name]), nan=np.inf))


def balance(end: Ended) -> Iterator[Check]:
    """The body whose forces are farthest from adding up to zero."""
    if end.imbalance:
        name = worst_of(end.imbalance)
        error = end.imbalance[name]
        message = f"force imbalance on body {name}: {100 * error:.2g} % of the largest force"
        finer = finer_nodes(end.case, [name])
        hint = f"{finer} where it is held and around its notches, or use mls.degree = 4"
        yield Check("force_balance", error, message, hint, f"body {name}")


def work(end: Ended) -> Iterator[Check]:
    """The body whose energy differs most from the work done on it."""
    name = worst_of(end.energies.bodies)
    error = end.energies.bodies[name]
    size = f"{100 * abs(error):.2g} % {'below' if error < 0.0 else 'above'}"
    message = f"{end.energies.what} body {name} is {size} the work done on it"
    where = end.energies.thin.get(name) or "where it is held and around its notches"
    hint = f"{finer_nodes(end.case, [name])}, above all {where}"
    yield Check(end.energies.name, abs(error), message, hint, f"body {name}")


def single_nodes(end: Ended) -> Iterator[Check]:
    """Bodies held at single nodes, whose displacements depend on the spacing."""
    for name, part in end.energies.pointed.items():
        message = (
            f"body {name} is held at single nodes: displacements next to a point force are unbounded, and "
            f"grow by about {100 * part:.2g} % when its spacing is halved"
        )
        hint = (
            "support a part of a boundary (from, to), or measure displacements relative to another point "
            "than the fixed one"
        )
        yield Check("single_nodes", part, message, hint, f"body {name}")


def thin_part(cloud: Cloud) -> str:
    """Place where a body has too few nodes across for bending, and the spacing it needs ("" if none)."""
    across = cloud.spacings_across
    if across > BENDING_NODES - 1.5:
        return ""
    node = (cloud.widths / cloud.spacing).argmin()
    x, y = cloud.points[node]
    return (
        f"near ({x:.6g}, {y:.6g}), where it has {round(across) + 1} nodes across: parts in bending need "
        f"{BENDING_NODES} or more, a spacing of {cloud.widths[node] / (BENDING_NODES - 1):.3g}"
    )


def displacement_estimate(case: Case, figures: Mapping[str, Any]) -> Iterator[Check]:
    """The largest estimated error of displacements, of all or at a probe."""
    probes = figures.get("probes", {}).items()
    errors = {f"the displacement at probe {name} is": error for name, error in probes}
    if figures["displacement"] is not None:
        errors["displacements are"] = figures["displacement"]
    if errors:
        worst, finer = worst_of(errors), finer_nodes(case, [body.name for body in case.body])
        message = f"{worst} estimated to be off by {100 * errors[worst]:.2g} %"
        hint = f"{finer}, above all where bodies are held, loaded or bent"
        yield Check("displacement_error", errors[worst], message, hint)


def force_estimate(limit: str, case: Case, contact: str, bodies: Collection[str], error: float) -> Check:
    """Estimated error of the force of a contact that finer nodes in ``bodies`` reduce."""
    message = f"contact {contact}: its force is estimated to be off by {100 * error:.2g} %"
    hint = f"{finer_nodes(case, bodies)}, above all where bodies are held or touch"
    return Check(limit, error, message, hint, f"contact {contact}")


def pressure_estimate(
    limit: str, case: Case, contact: str, bodies: Collection[str], error: float | None, more: str = ""
) -> Iterator[Check]:
    """Estimated error of the pressures of a contact, if there is one; ``more`` of a hint."""
    if error is not None:
        message = f"contact {contact}: pressures are estimated to be off by {100 * error:.2g} %"
        yield Check(limit, error, message, f"{finer_nodes(case, bodies)}{more}", f"contact {contact}")


COMMON: Sequence[Callable[[Ended], Iterator[Check]]] = (balance, work, single_nodes)
"""Checks of a completed path at either strain."""
