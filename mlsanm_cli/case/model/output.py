"""Output files, probes, units and reference solutions."""

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.fields import LENGTH, Name, Unit, Vector
from mlsanm_cli.case.model.model import UNSUPPORTED
from mlsanm_cli.case.model.section import Scope, Section
from mlsanm_cli.errors import Fault

Symbol = Annotated[str, Field(max_length=20)]


class Units(Section):
    """Unit symbols shown in pictures and reports. Nothing is converted."""

    length: Symbol = ""
    """Unit of lengths and displacements, as in "mm"."""
    stress: Symbol = ""
    """Unit of stresses and pressures, as in "MPa"."""
    force: Symbol = ""
    """Unit of forces per unit thickness, as in "N/mm"."""

    def label(self, text: str, kind: str) -> str:
        """A label with the unit of a ``kind`` (length, stress or force), if it is given."""
        symbol = getattr(self, kind, "")
        return f"{text} [{symbol}]" if symbol else text


class Probe(Section):
    """Displacement and stress at a point of a body, recorded at every step."""

    name: Name
    """Name; values are stored as `/probes/<name>` in run.h5."""
    body: str
    """Body that contains the point."""
    point: Annotated[Vector, LENGTH]
    """Coordinates in the undeformed body, inside it or on its boundary."""


class Output(Section):
    """Output files."""

    at: Annotated[tuple[float, ...], Unit("position on the path")] = ()
    """Path positions (completed stages + fraction of the current one) at which fields are written; the end of
    the path if empty."""
    fields: tuple[Literal["displacement", "stress", "von_mises", "strain"], ...] = (
        "displacement",
        "stress",
        "von_mises",
    )
    """Fields to write."""
    vtu: bool = True
    """Write VTU files for ParaView."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        for field, times in Counter(self.fields).items():
            if times > 1:
                yield Fault(("fields",), f'"{field}" is listed {times} times')
        stages = len(scope.case.stage)
        for index, position in enumerate(self.at if scope.complete("stage") else ()):
            if not 0.0 <= position <= stages:
                message = f"{position:g} is outside the path, which goes from 0 to {stages}"
                yield Fault(("at", index), message, "a position is the stage index + fraction")


class Reference(Section):
    """Analytical solution for comparison; its parameters are taken from the case."""

    solution: Literal["hertz-line", "uniform-pressure"]
    """Hertz' line contact or a uniform pressure; a solution that does not match the scene is an error."""

    def faults(self, scope: Scope) -> Iterator[Fault]:
        if scope.strain == "finite":
            yield Fault((), f"an analytical solution {UNSUPPORTED}", "remove the table")
