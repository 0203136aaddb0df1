"""``[[stop]]``: conditions that end the path before the last stage is complete."""

from __future__ import annotations

from typing import Annotated, Literal

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import Section, Unit
from mlsanm_cli.case.report import Report, suggestion

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


def check_stop(stop: Stop, path: KeyPath, names: dict[str, list[str]], report: Report) -> None:
    """Adds problems for missing or double limits and unknown names. ``names`` are those of the items of the
    case by section ("load", "contact", "probe", "support"), and of its platen and obstacle loads
    ("rigid")."""
    given = [key for key in ("above", "below") if getattr(stop, key) is not None]
    if stop.what == "fold":
        for key in (*given, *(("of",) if stop.of else ())):
            report.add((*path, key), "does not apply to a fold", "remove it")
        return
    if len(given) != 1:
        report.add(path, "needs exactly one of above and below", "as in above = 100.0")
    if stop.component != "size" and stop.what not in VECTORS:
        report.add((*path, "component"), f"{stop.what} has no components", "remove it")
    sections = {
        "force": ("load", "contact", "support"),
        "displacement": ("rigid", "probe"),
        "von_mises": ("probe",),
    }.get(stop.what, ("contact",))
    known = [name for section in sections for name in names[section]]
    if stop.of not in known:
        what = {"rigid": "platen or obstacle load"}
        there = " or ".join(what.get(section, section) for section in sections)
        message = f'there is no {there} "{stop.of}"' if stop.of else f"missing: the name of a {there}"
        report.add((*path, "of"), message, suggestion(stop.of, known))
