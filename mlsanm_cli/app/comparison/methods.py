"""The methods of `mlsanm compare`, as changes of the case by ``--set``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mlsanm_cli.case import Case

ANM, NEWTON, ACTIVE_SET, POLISHED = "anm", "newton", "active-set", "anm polished"
MONOLITHIC = " monolithic"


@dataclass(frozen=True)
class Method:
    """A method's ``name`` in the table and the ``changes`` of the case that select it."""

    name: str
    changes: tuple[str, ...]

    @property
    def is_monolithic(self) -> bool:
        """Whether the displacements of the bodies are among its unknowns."""
        return self.name.endswith(MONOLITHIC)


def method_of(case: Case, name: str, softer: float = 1.0) -> Method:
    """A method for the scene of the case, with eta and stick of all contacts multiplied by ``softer``."""
    law = "exact" if name == ACTIVE_SET else "hyperbolic"
    changes = [f'contact.{contact.name}.regularization.law="{law}"' for contact in case.touching]
    if softer != 1.0:
        changes += [
            f"contact.{contact.name}.regularization.{key}={softer * getattr(contact.regularization, key)!r}"
            for contact in case.touching
            for key in (("eta", "stick") if contact.friction else ("eta",))
        ]
    formulation = "monolithic" if name.endswith(MONOLITHIC) else "condensed"
    solver = name.removesuffix(MONOLITHIC)
    changes += [
        f'solver.method="{ANM if solver == POLISHED else solver}"',
        f'solver.formulation="{formulation}"',
        f"solver.polish={'true' if solver == POLISHED else 'false'}",
    ]
    return Method(name, tuple(changes))


def chosen_methods(case: Case, asked: Iterable[str]) -> tuple[Method, ...]:
    """ANM, the methods ``asked`` for, and that of the case, in the order of the table.

    ``asked`` may contain "newton", "active-set" and "monolithic", which applies to all regularised methods.
    """
    wanted = {ANM, *asked, *_own(case)}
    names = [name for name in (ANM, NEWTON) if name in wanted]
    if "monolithic" in wanted:
        names += [f"{name}{MONOLITHIC}" for name in names]
    names += [name for name in (POLISHED, ACTIVE_SET) if name in wanted]
    return tuple(method_of(case, name) for name in names)


def _own(case: Case) -> Iterator[str]:
    if case.touching and case.touching[0].regularization.law == "exact":
        yield ACTIVE_SET
    if case.solver.polish is True:
        yield POLISHED
    yield case.solver.method
    yield case.solver.formulation


def law_of(case: Case) -> str:
    """The law that the states at the levels satisfy; states of the same law differ by tolerances only."""
    regular = case.touching[0].regularization
    holonomic = any(c.friction and c.regularization.friction_law == "holonomic" for c in case.touching)
    if regular.law == "exact" or case.polished:
        return "exact holonomic" if holonomic else "exact"
    return "holonomic" if holonomic else "hyperbolic"
