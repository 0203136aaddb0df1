"""``mlsanm report``: runs as one HTML file, with cases, pictures, tables, checks and provenance."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mlsanm_cli.app.results.choice import Choice
from mlsanm_cli.app.results.collect import collect
from mlsanm_cli.app.results.info import info
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.case import Case, Displacement, stored_case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import html, run_dir
from mlsanm_cli.io.plots.figures import resolution
from mlsanm_cli.io.run_reader import RunData, read_run
from mlsanm_cli.roundoff import ROUND_OFF

DPI = 110
"""Resolution of pictures, at which a report on three runs is below 3 MB."""
MAX_VARIED_KEYS = 15
"""Largest number of differing keys that are compared."""
MAX_CONTACTS = 4
"""Largest number of contacts that are drawn, those with the largest pressures."""
ESTIMATES = {
    "pressure": "pressures of {}",
    "force": "force of {}",
    "contacts": "force of {}",
    "probes": "displacement at {}",
}
"""Error estimates of contacts and probes in words."""
COMPARED = ("status", "position", "steps", "nodes", "warnings")
CHECKS = {
    "residual": ("equations of contact", "below"),
    "linear_residual": ("linear systems", "below"),
    "force_balance": ("balance of the forces on every body", "below"),
    "energy_error": ("strain energy against work of the loads", "within"),
    "stability": ("stability of the discretisation", "above"),
}
ORIGINS = {"git": "commit", "argv": "command", "cpu": "processor"}
CAPTIONS = {
    "pressure": "Contact pressure along {subject}",
    "traction": "Tangential traction along {subject}, between its friction limits",
    "loop": "Tangential force over displacement, {subject}",
    "force": "Forces along the load path",
    "peak": "Peak pressure along the load path",
    "bodies": "The deformed bodies, with supports, loads and obstacles",
}


def report(rundirs: Sequence[Path], out: Path | None = None) -> Path:
    """Writes a page about one run or several, by default to ``report.html`` in the run directory or, for
    several runs, in the current one. Raises RunError for directories without a readable run, and if the file
    cannot be written or is not a report of mlsanm."""
    runs = [read_run(place) for place in rundirs]
    path = out or (runs[0].directory / run_dir.REPORT_FILE if len(runs) == 1 else Path(run_dir.REPORT_FILE))
    if path.suffix.lower() not in (".html", ".htm"):
        raise RunError(f"{path}: a report ends in .html", "as in -o report.html")
    cases = [stored_case(run.case_resolved) for run in runs]
    titles = [case.title or run.directory.name for run, case in zip(runs, cases, strict=True)]
    parts = [html.heading(1, titles[0] if len(runs) == 1 else f"{len(runs)} runs")]
    if len(runs) > 1:
        names = [(f"run-{number}", title) for number, title in enumerate(titles, start=1)]
        parts += [html.links("Runs", names), _compared(runs, titles)]
    for number, (run, case, title) in enumerate(zip(runs, cases, titles, strict=True), start=1):
        parts += [html.heading(2, title if len(runs) > 1 else "Result", f"run-{number}")]
        parts += _one(run, case)
    html.write_page(path, html.page("mlsanm: " + ", ".join(titles), "\n".join(parts)))
    return path


def _one(run: RunData, case: Case) -> Iterator[str]:
    summary = info(run.directory)
    good = summary["status"] == "done"
    reason = summary.get("stop_reason")
    verdict = f"{summary['status']}: {reason}" if reason else str(summary["status"])
    yield html.paragraph(verdict, "good" if good else "bad")
    if summary.get("hint"):
        yield html.paragraph(f"Hint: {summary['hint']}")
    warnings = [str(text) for text in summary.get("warnings", [])]
    if warnings:
        yield html.heading(3, f"Warnings ({len(warnings)})")
        yield html.listing(warnings)
    yield html.heading(3, "Figures")
    yield from _figures(summary, case)
    yield html.heading(3, "Error estimates and checks")
    yield _checks(summary)
    if run.rows:
        yield html.heading(3, "Pictures")
        yield from _pictures(run)
    yield html.heading(3, "The case")
    yield html.source(run.case_raw or run.case_resolved, f"case file of {run.directory.name}")
    yield html.heading(3, "Provenance")
    yield _origin(summary)


def _figures(summary: Mapping[str, Any], case: Case) -> Iterator[str]:
    units = case.units
    contacts: Mapping[str, Any] = summary.get("contacts") or {}
    if contacts:
        columns = [
            "contact",
            units.label("peak pressure", "stress"),
            units.label("half-width", "length"),
            units.label("force on the slave, x", "force"),
            units.label("force on the slave, y", "force"),
            "closed nodes",
            "analytical solution",
        ]
        rows = [[name, *_contact(figures)] for name, figures in contacts.items()]
        yield html.table("Contacts at the end", columns, rows)
    forces = _joined_forces(summary.get("forces") or {}, case)
    if forces:
        columns = ["load or support", units.label("force x", "force"), units.label("force y", "force")]
        yield html.table("Forces on the bodies", columns, [[name, *force] for name, force in forces])
    probes: Mapping[str, Any] = summary.get("probes") or {}
    if probes:
        names = ("ux", "uy", "stress xx", "stress yy", "stress xy", "von Mises stress")
        kinds = ("length", "length", "stress", "stress", "stress", "stress")
        columns = ["probe", *(units.label(name, kind) for name, kind in zip(names, kinds, strict=True))]
        rows = [
            [name, *map(_number, (*one["displacement"], *one["stress"], one["von_mises"]))]
            for name, one in probes.items()
        ]
        yield html.table("Probes at the end", columns, rows)
    sizes = [
        ("position on the path", summary.get("position")),
        ("steps", summary.get("steps")),
        ("nodes", summary.get("nodes")),
        ("contact unknowns", summary.get("contact_unknowns")),
        ("CPU time in s", _rounded((summary.get("seconds") or {}).get("total"), 1)),
        ("elapsed time in s", _rounded(summary.get("wall_seconds"), 1)),
        ("memory in MB", _rounded(summary.get("peak_memory_mb"), 0)),
    ]
    yield html.table(
        "Size and cost", [], [[name, _number(value)] for name, value in sizes if value is not None]
    )


def _joined_forces(forces: Mapping[str, Any], case: Case) -> list[tuple[str, list[str]]]:
    """Names and forces of loads and supports, without contacts; displacement loads on the same boundary have
    one force."""
    places = {load.name: load.place for load in case.load if isinstance(load, Displacement)}
    zero = ROUND_OFF * max((abs(part) for force in forces.values() for part in force), default=0.0)
    joined: dict[Any, tuple[list[str], list[str]]] = {}
    for name, force in forces.items():
        if not name.startswith("contact "):
            shown = [_number(part if abs(part) > zero else 0.0) for part in force]
            joined.setdefault(places.get(name, name), ([], shown))[0].append(name)
    return [(", ".join(names), shown) for names, shown in joined.values()]


def _contact(figures: Mapping[str, Any]) -> list[str]:
    force = figures.get("force") or (None, None)
    known = "none"
    reference = figures.get("reference")
    if reference and reference.get("pressure_error_l2") is not None:
        known = f"{reference['solution']}: error {100.0 * float(reference['pressure_error_l2']):.2g} %"
    peak = _number(figures.get("peak_pressure"))
    peak += " (singular end)" if figures.get("singular_ends") else ""
    values = (figures.get("half_width"), *force, figures.get("closed_nodes"))
    return [peak, *map(_number, values), known]


def _checks(summary: Mapping[str, Any]) -> str:
    rows = []
    limits: Mapping[str, Any] = summary.get("limits") or {}
    for key, (what, word) in CHECKS.items():
        value, limit = summary.get(key), limits.get(key)
        if value is None:
            continue
        passes = limit is None or (float(value) >= limit if word == "above" else abs(float(value)) <= limit)
        limit_text = "" if limit is None else f"{word} {_number(limit)}"
        rows.append(
            [what, _number(value), limit_text, html.GOOD + "passes" if passes else html.BAD + "fails"]
        )
    estimates, warned = _estimates(summary.get("error_estimate")), _estimates(limits.get("estimates"))
    for what, value in estimates.items():
        limit = warned.get(what)
        limit_text = "" if limit is None else f"below {100.0 * limit:g} %"
        if value is None:
            rows.append([f"error estimate, {what}", "not available", limit_text, ""])
            continue
        verdict = html.BAD + "large" if limit is not None and value > limit else html.GOOD + "passes"
        size = f"{100.0 * value:.2g} %"
        rows.append([f"error estimate, {what}", size, limit_text, "" if limit is None else verdict])
    return html.table("Checks", ["check", "value", "limit", "verdict"], rows)


def _estimates(tables: Mapping[str, Any] | None) -> dict[str, float | None]:
    """Error estimates, or their limits, by what they are of."""
    found = dict[str, float | None]()
    for key, value in (tables or {}).items():
        if isinstance(value, Mapping):
            found |= {ESTIMATES[key].format(name): one for name, one in value.items()}
        else:
            found[key] = value
    return found


def _pictures(run: RunData) -> Iterator[str]:
    peaks = {name: float(contact.pressure.max(initial=0.0)) for name, contact in run.contacts.items()}
    drawn = sorted(peaks, key=lambda name: -peaks[name])[:MAX_CONTACTS]
    if len(drawn) < len(peaks):
        yield html.paragraph(
            f"{len(drawn)} of {len(peaks)} contacts are drawn, those with the largest pressures."
        )
    with tempfile.TemporaryDirectory() as place, resolution(DPI):
        for kind in ("bodies", "pressure", "traction", "loop", "force", "peak"):
            for subject in drawn if kind in ("pressure", "traction", "loop") else [""]:
                file = Path(place) / f"{kind}.png"
                try:
                    plot(run.directory, choice=Choice(what=(kind,), contact=subject or None, out=file))
                except RunError:
                    # Not available in this run: without friction, contact or fields.
                    continue
                caption = CAPTIONS[kind].format(subject=subject)
                yield html.image(file.read_bytes(), _described(run, kind, subject), caption)


def _described(run: RunData, kind: str, subject: str) -> str:
    """The alternative text of a picture."""
    caption = CAPTIONS[kind].format(subject=subject)
    if kind != "pressure":
        return f"{caption}, of bodies {', '.join(run.bodies)}" if kind == "bodies" else caption
    pressure = run.contacts[subject].pressure[-1]
    arc = run.contacts[subject].arc_length
    peak = float(pressure.max(initial=0.0))
    where = f" at arc length {arc[pressure.argmax()]:.4g}" if peak > 0.0 else ""
    return f"{caption}: at most {peak:.5g}{where}, at the end of the path"


def _compared(runs: Sequence[RunData], titles: Sequence[str]) -> str:
    """The keys that differ between the cases, and the main figures."""
    rows = collect([run.directory for run in runs])
    keys = [key for key in rows[0] if key not in ("directory", "stop_reason")]
    figures = [
        key for key in keys if key.startswith("contacts.") and key.endswith(("peak_pressure", "half_width"))
    ]
    first = keys.index("status") + 1
    last = next((index for index, key in enumerate(keys) if key == "position"), len(keys))
    varied = keys[first:last]
    # The files of very different cases are shown below.
    varied = varied if len(varied) <= MAX_VARIED_KEYS else []
    chosen = [*varied, *(key for key in COMPARED if key in keys), *figures]
    lines = [[_named(key), *(_number(row[key]) for row in rows)] for key in chosen]
    return html.table("The runs side by side", ["", *titles], lines)


def _named(key: str) -> str:
    """A column in words: contacts.nose.reference.peak_pressure is nose: reference peak pressure."""
    if not key.startswith("contacts."):
        return key
    _, name, *words = key.split(".")
    return f"{name}: {' '.join(words).replace('_', ' ')}"


def _origin(summary: Mapping[str, Any]) -> str:
    rows = [["directory", str(summary["directory"])]]
    rows += [
        [ORIGINS.get(key, key.replace("_", " ")), str(value)]
        for key, value in summary.get("provenance", {}).items()
    ]
    return html.table("Program, machine and files", [], rows)


def _rounded(value: float | None, digits: int) -> str | None:
    return None if value is None else f"{value:.{digits}f}"


def _number(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value)
