"""``[units]``: unit symbols for pictures and reports. Nothing is converted."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mlsanm_cli.case.model.base import Section

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
