"""``[[stop]]``: conditions that end the path before the last stage is complete."""

from collections.abc import Iterator
from typing import Annotated, Literal

from mlsanm_cli.case.model.fields import Unit
from mlsanm_cli.case.model.section import Scope, Section
from mlsanm_cli.case.report import suggestion
from mlsanm_cli.errors import Fault

UNIT_OF_QUANTITY = Unit("unit of the quantity")
VECTORS = ("force", "displacement")


class Stop(Section):
    """Condition that ends the path at the load where a quantity reaches a limit."""

    what: Literal["force", "displacement", "pressure", "area", "slip", "von_mises", "fold"]
    """Force of a load, support or contact; displacement of a platen, obstacle or probe; of a contact the
    largest pressure, the length in contact (area) or the largest slip where it is closed; von Mises stress at
    a probe; or a fold (limit point)."""
    of: str = ""
    """Name of the load, contact or probe, or boundary of the support; empty for a fold."""
    component: Literal["x", "y", "size"] = "size"
    """Component of a force or displacement, with its sign, or its magnitude (size)."""
    above: Annotated[float | None, UNIT_OF_QUANTITY] = None
    """Limit reached from below; give `above` or `below`."""
    below: Annotated[float | None, UNIT_OF_QUANTITY] = None
    """Limit reached from above; give `above` or `below`."""

    @property
    def description(self) -> str:
        """The condition in words."""
        if self.what == "fold":
            return "fold (limit point of the load)"
        along = f" in {self.component}" if self.component != "size" else ""
        side, value = ("above", self.above) if self.above is not None else ("below", self.below)
        return f"{self.what.replace('_', ' ')} of {self.of}{along} {side} {value:g}"

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if self.what == "fold":
            for key in (*self.given("above", "below"), *(("of",) if self.of else ())):
                yield Fault((key,), "does not apply to a fold", "remove it")
            return
        yield from self.exclusive("above", "below")
        if self.component != "size" and self.what not in VECTORS:
            yield Fault(("component",), f"{self.what} has no components", "remove it")
        what, sections, known = self._named(scope)
        if self.of not in known and scope.complete(*sections):
            message = f'there is no {what} "{self.of}"' if self.of else f"missing: the name of a {what}"
            yield Fault(("of",), message, suggestion(self.of, known))
        if self.what == "slip" and any(c.name == self.of and not c.friction for c in scope.case.contact):
            yield Fault(("of",), f'contact "{self.of}" is frictionless and has no slip')

    def _named(self, scope: Scope) -> tuple[str, tuple[str, ...], list[str]]:
        """What ``of`` can name: in words, the sections, and the names."""
        names = scope.names
        if self.what == "force":
            supports = [one.boundary for one in scope.case.support if isinstance(one.boundary, str)]
            known = [*names["load"], *names["contact"], *supports]
            return "load or contact or support", ("support",), known
        if self.what == "displacement":
            rigid = [one.name for one in scope.case.load if one.kind in ("platen", "obstacle")]
            return "platen or obstacle load or probe", ("load",), [*rigid, *names["probe"]]
        section = "probe" if self.what == "von_mises" else "contact"
        return section, (), list(names[section])
