"""The closing table of a run: what an engineer wants to know first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mlsanm_cli.cli.text import label, number, table

_CONTACT = ("peak_pressure", "half_width", "force", "min_gap", "stick_nodes", "slip_nodes")
_QUALITY = ("residual", "force_balance", "stability", "peak_memory_mb")


def run_text(summary: Mapping[str, Any], color: bool = False) -> str:
    """The summary of a run as text, contacts first."""
    parts = [table(_headline(summary), _outcome(summary), color)]
    contacts = summary.get("contacts", {})
    for name, contact in contacts.items():
        rows = [(label(key), number(contact[key])) for key in _CONTACT if key in contact]
        parts.append(table(f"contact {name}", rows, color))
    polish = summary.get("polish")
    if polish:
        rows = [
            (
                "largest change",
                f"pressure {100 * polish['pressure']:.2g} %, traction "
                f"{100 * polish['traction']:.2g} % of the peak pressure",
            ),
            ("cost", f"{polish['levels']} levels, {polish['factorizations']} factorizations"),
        ]
        parts.append(table("polished with the exact laws", rows, color))
    parts.append(table("quality and cost", _quality(summary), color))
    return "\n".join(parts)


def _headline(summary: Mapping[str, Any]) -> str:
    status = str(summary.get("status", "unknown"))
    reason = summary.get("stop_reason")
    return f"{status}: {reason}" if reason and str(reason) != status else status


def _outcome(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [("position", number(summary.get("position")))]
    counts = [
        f"{number(summary[key])} {key}" for key in ("steps", "factorizations", "solves") if key in summary
    ]
    if counts:
        rows.append(("path", ", ".join(counts)))
    if "directory" in summary:
        rows.append(("directory", str(summary["directory"])))
    return rows


def _quality(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [(label(key), number(summary[key])) for key in _QUALITY if key in summary]
    sizes = [
        f"{number(summary[key])} {label(key)}"
        for key in ("nodes", "unknowns", "contact_unknowns")
        if key in summary
    ]
    if sizes:
        rows.append(("size", ", ".join(sizes)))
    seconds = summary.get("seconds")
    if isinstance(seconds, Mapping):
        total = seconds.get("total")
        split = [
            f"{key} {float(value):.2f}"
            for key, value in seconds.items()
            if key != "total" and isinstance(value, int | float) and value >= 0.005
        ]
        text = f"{float(total):.2f}" if isinstance(total, int | float) else "-"
        rows.append(("CPU seconds", f"{text} ({', '.join(split)})" if split else text))
    return rows
