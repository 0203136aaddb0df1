"""``[[stop]]``: what ends a path before the end of its last stage."""

from __future__ import annotations

from typing import Annotated, Literal

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import Section, Unit
from mlsanm_cli.case.report import Report, suggestion

AS_ASKED = Unit("as what is asked for")
VECTORS = ("force", "displacement")


class Stop(Section):
    """Ends the path, done, at the exact load at which something is reached; of several the first one does."""

    what: Literal["force", "displacement", "pressure", "area", "slip", "von_mises", "fold"]
    """Force of a load, support or contact; displacement of a platen, obstacle or probe; largest pressure,
    closed length (area) or largest slip of a contact; von Mises stress at a probe; or a fold, where loads can
    rise no further."""
    of: str = ""
    """Name of the load, contact or probe, or boundary of the support."""
    component: Literal["x", "y", "size"] = "size"
    """Of a force or displacement: along x or y, with its sign, or its size."""
    above: Annotated[float | None, AS_ASKED] = None
    """The path ends where the value comes from below and reaches this."""
    below: Annotated[float | None, AS_ASKED] = None
    """The path ends where the value comes from above and reaches this."""

    @property
    def told(self) -> str:
        """The condition in words."""
        if self.what == "fold":
            return "fold: the loads can rise no further"
        along = f" in {self.component}" if self.component != "size" else ""
        side, value = ("above", self.above) if self.above is not None else ("below", self.below)
        return f"{self.what.replace('_', ' ')} of {self.of}{along} {side} {value:g}"


def check_stop(stop: Stop, path: KeyPath, names: dict[str, list[str]], report: Report) -> None:
    """Adds a problem for limits that are missing or double, and for names of what there is not.

    ``names`` are those of the load, contact, probe and support items of the case, and of what moves rigidly
    as "mover".
    """
    given = [key for key in ("above", "below") if getattr(stop, key) is not None]
    if stop.what == "fold":
        for key in (*given, *(("of",) if stop.of else ())):
            report.add((*path, key), "a fold has none", "remove it")
        return
    if len(given) != 1:
        report.add(path, "needs exactly one of above and below", "as in above = 100.0")
    if stop.component != "size" and stop.what not in VECTORS:
        report.add((*path, "component"), f"{stop.what} has no components", "remove it")
    sections = {
        "force": ("load", "contact", "support"),
        "displacement": ("mover", "probe"),
        "von_mises": ("probe",),
    }.get(stop.what, ("contact",))
    known = [name for section in sections for name in names[section]]
    if stop.of not in known:
        what = {"mover": "platen or obstacle load"}
        there = " or ".join(what.get(section, section) for section in sections)
        message = f'there is no {there} "{stop.of}"' if stop.of else f"missing: the name of a {there}"
        report.add((*path, "of"), message, suggestion(stop.of, known))
