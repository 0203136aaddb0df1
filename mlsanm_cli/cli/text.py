"""Tables and numbers as text; the summary of a run and of a comparison."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from mlsanm_cli.toml import plain

MAX_LINE_LENGTH = 2000
BOLD, RED, YELLOW, DIM = "1", "31", "33", "2"


def paint(text: str, code: str, color: bool) -> str:
    return f"\x1b[{code}m{text}\x1b[0m" if color and text else text


def printable(text: str) -> str:
    r"""The text with control characters escaped and very long lines shortened.

    >>> printable("a\x1b[2Jb")
    'a\\x1b[2Jb'
    """
    half = MAX_LINE_LENGTH // 2
    shown = [x if len(x) <= 2 * half else f"{x[:half]} [...] {x[-half:]}" for x in text.split("\n")]
    return "".join(c if c.isprintable() or c in "\t\n" else ascii(c)[1:-1] for c in "\n".join(shown))


def as_json(value: Any) -> str:
    return json.dumps(plain(value), indent=2, allow_nan=False)


def number(value: Any) -> str:
    """A value as a cell of a table.

    >>> number(0.000123456789), number([0.0, -350.0]), number(True), number(None)
    ('0.000123457', '0, -350', 'yes', '-')
    """
    value = plain(value)
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(number(item) for item in value) or "none"
    return printable(str(value))


LABELS = {
    "finest": "finest spacing",
    "closest": "separation distance, in spacings",
    "hole": "fill distance, in spacings",
    "growth": "growth of spacing",
    "stencils_enlarged": "enlarged stencils",
    "worst_ratio": "conditioning of stencils",
    "git": "commit",
    "argv": "command",
}
"""Headings of keys whose names are too short."""


def label(key: str) -> str:
    """A key as a heading: ``peak_pressure`` as ``peak pressure``."""
    words = LABELS.get(key) or key.replace("_", " ")
    return words.replace(" cpu ", " CPU ").removesuffix(" mb") + (" in MB" if words.endswith(" mb") else "")


def table(title: str, rows: Sequence[tuple[str, str]], color: bool = False) -> str:
    """Two aligned columns with a title."""
    width = max((len(name) for name, _ in rows), default=0)
    lines = [paint(title, BOLD, color)] if title else []
    lines += [f"  {name:<{width}}  {value}".rstrip() for name, value in rows]
    return "\n".join(lines)


def grid(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], color: bool = False) -> str:
    """A table with a heading per column; the first column is left-aligned, the others right-aligned."""
    widths = [max(map(len, cells)) for cells in zip(columns, *rows, strict=True)]
    lines = []
    for row in (columns, *rows):
        _, *others = (cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        lines.append("  " + "  ".join([row[0].ljust(widths[0]), *others]).rstrip())
    heading = [paint(title, BOLD, color)] if title else []
    return "\n".join([*heading, paint(lines[0], DIM, color), *lines[1:]])


def pretty(mapping: Mapping[str, Any], title: str = "", color: bool = False, width: int = 100) -> str:
    """A nested mapping as tables: values as rows, similar mappings as columns."""
    if mapping and title and all(isinstance(value, dict) for value in mapping.values()):
        return _items(title, mapping, color, width)
    flat: list[tuple[str, str]] = []
    blocks: list[str] = []
    for key, value in mapping.items():
        value, heading = plain(value), f"{title} {label(key)}".strip()
        if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            value = {str(index): item for index, item in enumerate(value, start=1)}
        if isinstance(value, list) and any(isinstance(item, str) and " " in item for item in value):
            blocks.append(table(heading, [("-", str(item)) for item in value], color))
        elif not isinstance(value, dict):
            flat.append((label(key), number(value)))
        elif value:
            blocks.append(pretty(value, heading, color, width))
    first = [table(title, flat, color)] if flat or not blocks else []
    return "\n".join([*first, *blocks])


def _items(title: str, items: Mapping[str, Mapping[str, Any]], color: bool, width: int) -> str:
    """Items with the same keys: one row each if they fit, else one table each."""
    keys = list(dict.fromkeys(key for item in items.values() for key in item))
    simple = not any(isinstance(item.get(key), dict) for item in items.values() for key in keys)
    rows = [[name, *(number(item.get(key)) for key in keys)] for name, item in items.items()]
    columns = ["", *map(label, keys)]
    used = sum(max(len(row[i]) for row in [columns, *rows]) + 2 for i in range(len(columns)))
    if simple and used <= width:
        return grid(title, columns, rows, color)
    return "\n".join(pretty(item, f"{title} {label(name)}", color, width) for name, item in items.items())


FRICTION_KEYS = ("stick_nodes", "slip_nodes", "dissipated_work", "max_cone_ratio", "peak_traction")
"""Keys of a summary that are meaningful for contacts with friction only."""
_QUALITY = ("residual", "force_balance", "energy_error", "stability", "peak_memory_mb")


def run_text(summary: Mapping[str, Any], color: bool, width: int = 100) -> str:
    """The summary of a run as text, contacts first, with lines wrapped at ``width``."""
    status, reason = str(summary.get("status", "unknown")), str(summary.get("stop_reason") or "")
    headline = reason if reason.startswith(status) else f"{status}: {reason}" if reason else status
    counts, directory = _listed(summary, ("steps", "factorizations", "solves")), summary.get("directory", "")
    rows = [("position", number(summary.get("position"))), ("path", counts), ("directory", str(directory))]
    parts = [table(headline, [row for row in rows if row[1]], color)]
    for name, contact in summary.get("contacts", {}).items():
        parts.append(table(f"contact {name}", _contact(name, contact, summary), color))
    for name, probe in summary.get("probes", {}).items():
        parts.append(table(f"probe {name}", [(label(key), number(probe[key])) for key in probe], color))
    parts.append(table("quality and cost", _quality(summary, width), color))
    return "\n".join(parts)


def _contact(name: str, contact: Mapping[str, Any], summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The main results of a contact with their error estimate."""
    keys = ("peak_pressure", "peak_tension", "peak_traction", "half_width", "force", "min_gap")
    rows = [(label(key), number(contact[key])) for key in keys if key in contact]
    if contact.get("singular_ends"):
        rows[0] = ("peak pressure", f"{rows[0][1]} at a singular end: it depends on the grid")
    nodes = ("stick_nodes", "slip_nodes") if has_friction(contact) else ("closed_nodes",)
    rows += [(label(key), number(contact[key])) for key in nodes if key in contact]
    pressures = (summary.get("error_estimate") or {}).get("pressure", {})
    if name in pressures:
        rows.append(("error estimate", _percent(pressures[name], "of the pressures")))
    reference = contact.get("reference")
    if reference:
        error = _percent(reference.get("pressure_error_l2"), "pressure error")
        peak = number(reference.get("peak_pressure"))
        rows.append((str(reference.get("solution")), f"{error}, peak {peak}"))
    return rows


def has_friction(contact: Mapping[str, Any]) -> bool:
    return contact.get("max_cone_ratio") is not None or "closed_nodes" not in contact


def _percent(value: Any, of: str) -> str:
    return "unknown" if value is None else f"{100.0 * float(value):.2g} % {of}"


_WORK = {
    "method": "",
    "law": "law",
    "steps": "steps",
    "iterations": "iterations",
    "dense_factorizations": "dense fact.",
    "dense_solves": "solves",
    "sparse_factorizations": "sparse fact.",
    "sparse_solves": "solves",
    "seconds_setup": "set-up s",
    "seconds_path": "path s",
}
_DIFFERENCES = ("pressure", "traction", "displacement")


def comparison_text(result: Mapping[str, Any], color: bool) -> str:
    """A comparison as text: work and differences of the methods."""
    methods = result["methods"]
    cells = [[method[key] for key in _WORK] for method in methods]
    work = [[f"{one:.3g}" if isinstance(one, float) else number(one) for one in row] for row in cells]
    parts = [grid("work and CPU seconds", list(_WORK.values()), work, color)]
    columns = ["", "against", *(f"{name} diff." for name in _DIFFERENCES), "limit", "agrees"]
    analytic = any("reference_error" in method for method in methods)
    columns += ["reference error"] if analytic else []
    rows = []
    for method in methods:
        difference, row = method.get("difference"), ["-"] * (len(_DIFFERENCES) + 3)
        if difference is not None:
            agrees = "converges" if method["agrees"] and "convergence" in method else number(method["agrees"])
            values = [f"{difference[name]:.2g}" for name in _DIFFERENCES]
            row = [method["against"], *values, f"{method['limit']:.2g}", agrees]
        if analytic:
            known = [error for error in method.get("reference_error", {}).values() if error is not None]
            row.append(f"{max(known):.2g}" if known else "-")
        rows.append([method["method"], *row])
    title = f"largest differences at {len(result['levels'])} load levels, relative to the peak"
    parts.append(grid(title, columns, rows, color))
    for method in (method for method in methods if method["status"] == "failed"):
        words = "; ".join(filter(None, (method["reason"], method["hint"])))
        parts.append(f"{method['method']} failed: {words}")
    verdicts = {"agree": "the methods agree", "disagree": "the methods disagree", "failed": "ANM failed"}
    return "\n".join([*parts, f"{verdicts[result['status']]}; written to {result['directory']}"])


def _listed(summary: Mapping[str, Any], keys: Sequence[str]) -> str:
    return ", ".join(f"{number(summary[key])} {label(key)}" for key in keys if summary.get(key) is not None)


def _quality(summary: Mapping[str, Any], width: int) -> list[tuple[str, str]]:
    estimates = summary.get("error_estimate") or {}
    rows = [
        ("error estimate", _percent(estimates[key], f"of the {words}"))
        for key, words in (("displacement", "displacements"), ("energy", "energy"))
        if key in estimates
    ]
    if peaks := summary.get("peak_stress"):
        body, peak = max(peaks.items(), key=lambda item: float(item[1]["error"]))
        x, y = map(number, peak["place"])
        error = _percent(peak["error"], "error")
        more = f", {number(peak['at_contact'])} at its contacts" if "at_contact" in peak else ""
        rows.append(("peak stress", f"{number(peak['stress'])} on {body} at ({x}, {y}), {error}{more}"))
    for key in (key for key in _QUALITY if key in summary):
        # With the limit at which a run fails.
        limit, shown = summary.get("limits", {}).get(key), number(summary[key])
        words = {"stability": "fails below", "energy_error": "fails beyond"}.get(key, "fails above")
        told = "" if limit is None or shown == "-" else f", {words} {number(limit)}"
        rows.append((label(key), f"{shown}{told}"))
    sizes = _listed(summary, ("nodes", "unknowns", "contact_unknowns"))
    rows += [("size", sizes)] if sizes else []
    if not (seconds := summary.get("seconds")):
        return rows
    if summary.get("wall_seconds") is not None:
        rows.append(("wall seconds", f"{summary['wall_seconds']:.2f}"))
    phases = {key: value for key, value in seconds.items() if key != "total" and value >= 0.005}
    split = ", ".join(f"{key} {value:.2f}" for key, value in phases.items())
    whole = f"{seconds['total']:.2f}" + (f" ({split})" if split else "")
    indent = max((len(name) for name, _ in rows), default=0) + 4
    first, *lines = textwrap.wrap(whole, max(width - indent - 1, 20))
    return [*rows, ("CPU seconds", first), *(("", line) for line in lines)]
