"""``mlsanm report``: runs as one HTML file, with cases, pictures, tables, checks and provenance."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mlsanm_cli.app.results.choice import OF_CONTACT, Choice
from mlsanm_cli.app.results.info import collect, info
from mlsanm_cli.app.results.plot import pictures, write
from mlsanm_cli.case import Case, Displacement, stored_case
from mlsanm_cli.errors import RunError
from mlsanm_cli.io import html, run_dir, schema
from mlsanm_cli.io.html import element
from mlsanm_cli.io.plots.figures import resolution
from mlsanm_cli.io.run_reader import RunData, read_run
from mlsanm_cli.roundoff import ROUND_OFF

COMPARED = ("status", "position", "steps", "nodes", "warnings")
MAIN = ("peak_pressure", "half_width")
SIZES = ("position", "steps", "nodes", "contact_unknowns", "wall_seconds", "peak_memory_mb")
OUTCOMES = {"failed": html.BAD + "fails", "warned": html.BAD + "warns", "passed": html.GOOD + "passes"}
CAPTIONS = {
    "bodies": "The deformed bodies, with supports, loads and obstacles",
    "pressure": "Contact pressure along {subject}",
    "traction": "Tangential traction along {subject}, between its friction limits",
    "loop": "Tangential force over displacement, {subject}",
    "force": "Forces along the load path",
    "peak": "Peak pressure along the load path",
}
"""The pictures of a report, in order."""


def report(rundirs: Sequence[Path], out: Path | None = None) -> Path:
    """Writes a page on runs, by default to the directory of the only run, else here. Raises RunError."""
    runs = [read_run(place) for place in rundirs]
    path = out or (runs[0].directory / run_dir.REPORT_FILE if len(runs) == 1 else Path(run_dir.REPORT_FILE))
    if path.suffix.lower() not in (".html", ".htm"):
        raise RunError(f"{path}: a report ends in .html", "as in -o report.html")
    cases = [stored_case(run.case_resolved) for run in runs]
    titles = [case.title or run.directory.name for run, case in zip(runs, cases, strict=True)]
    parts, anchors = [element("h1", titles[0])], [f"run-{number}" for number in range(1, len(runs) + 1)]
    if len(runs) > 1:
        links = html.links("Runs", list(zip(anchors, titles, strict=True)))
        parts = [element("h1", f"{len(runs)} runs"), links, _compared(runs, titles)]
    for run, case, title, anchor in zip(runs, cases, titles, anchors, strict=True):
        parts += [element("h2", title if len(runs) > 1 else "Result", id=anchor), *_one(run, case)]
    html.write_page(path, "mlsanm: " + ", ".join(titles), "\n".join(parts))
    return path


def main_figures(run: RunData) -> str:
    """Status, figures and sizes of a run as HTML."""
    summary = info(run.directory)
    return "\n".join([_status(summary), *_figures(summary, stored_case(run.case_resolved))])


def _status(summary: Mapping[str, Any]) -> str:
    words = [str(summary["status"]), *filter(None, [summary.get("stop_reason")])]
    return element("p", ": ".join(words), kind="good" if words[0] == "done" else "bad")


def _one(run: RunData, case: Case) -> Iterator[str]:
    summary = info(run.directory)
    yield _status(summary)
    if summary.get("hint"):
        yield element("p", f"Hint: {summary['hint']}")
    if warnings := [str(text) for text in summary.get("warnings", [])]:
        yield element("h3", f"Warnings ({len(warnings)})")
        yield html.listing(warnings)
    yield element("h3", "Figures")
    yield from _figures(summary, case)
    if summary.get("checks"):
        yield element("h3", "Error estimates and checks")
        rows = []
        for one in sorted(summary["checks"], key=lambda one: list(OUTCOMES).index(one["outcome"])):
            name, place, *levels = (one[key] for key in ("name", "place", "value", "limit"))
            rows.append([name.replace("_", " "), place, *map(_number, levels), OUTCOMES[one["outcome"]]])
        yield html.table("Checks", ["check", "of", "value", "limit", "outcome"], rows)
    if run.rows:
        yield element("h3", "Pictures")
        yield from _pictures(run, case)
    yield element("h3", "The case")
    yield html.source(run.case_raw or run.case_resolved, f"case file of {run.directory.name}")
    yield element("h3", "Provenance")
    origin = {"directory": summary["directory"], **summary.get("provenance", {})}
    words = {"git": "commit", "argv": "command", "cpu": "processor"}
    rows = [[words.get(key, key.replace("_", " ")), str(value)] for key, value in origin.items()]
    yield html.table("Program, machine and files", [], rows)


def _figures(summary: Mapping[str, Any], case: Case) -> Iterator[str]:
    contacts: Mapping[str, Any] = summary.get("contacts") or {}
    if contacts:
        shown = [f"contacts.{{contact}}.{name}" for name in (*MAIN, "force", "closed_nodes")]
        figures = [one for one in schema.CONTACT_FIGURES if one.path in shown]
        yield _table("Contacts at the end", "contact", contacts, figures, case)
    forces: Mapping[str, Any] = summary.get("forces") or {}
    places = {load.name: load.place for load in case.load if isinstance(load, Displacement)}
    zero = ROUND_OFF * max((abs(part) for force in forces.values() for part in force), default=0.0)
    # Displacement loads on the same boundary have one force.
    joined: dict[Any, tuple[list[str], list[str]]] = {}
    for name, force in forces.items():
        if not name.startswith("contact "):
            shown = [_number(part if abs(part) > zero else 0.0) for part in force]
            joined.setdefault(places.get(name, name), ([], shown))[0].append(name)
    if joined:
        columns = [case.units.label(f"force {axis}", "force") for axis in "xy"]
        rows = [[", ".join(names), *shown] for names, shown in joined.values()]
        yield html.table("Forces on the bodies", ["load or support", *columns], rows)
    if summary.get("probes"):
        yield _table("Probes at the end", "probe", summary["probes"], schema.PROBES, case)
    sizes = [(entry.description, summary.get(entry.name)) for entry in schema.SUMMARY if entry.path in SIZES]
    sizes.append(("CPU seconds", (summary.get("seconds") or {}).get("total")))
    rows = [[name, _number(value)] for name, value in sizes if value is not None]
    yield html.table("Size and cost", [], rows)


def _table(
    title: str, first: str, items: Mapping[str, Any], quantities: Sequence[schema.Quantity], case: Case
) -> str:
    """A table with a row per item and a column per component; for contacts also errors of closed formulas."""
    columns, rows = [first], {name: [name] for name in items}
    for entry in quantities:
        parts = schema.COMPONENTS.get(entry.dimensions[-1] if entry.dimensions else "", ("",))
        columns += [case.units.label(f"{entry.description} {part}".rstrip(), entry.unit) for part in parts]
        for name, figures in items.items():
            value = figures.get(entry.name)
            values = value if isinstance(value, list) else [value] * len(parts)
            singular = entry.name == "peak_pressure" and figures.get("singular_ends")
            rows[name] += [_number(part) + (" (singular end)" if singular else "") for part in values]
    if first == "contact":
        columns.append("closed formula")
        for name, figures in items.items():
            known = {"pressure_error_l2": None, **(figures.get("reference") or {})}
            error = known["pressure_error_l2"]
            shown = "none" if error is None else f"{known['solution']}: error {100 * float(error):.2g} %"
            rows[name].append(shown)
    return html.table(title, columns, list(rows.values()))


def _pictures(run: RunData, case: Case) -> Iterator[str]:
    peaks = {name: float(contact.pressure.max(initial=0.0)) for name, contact in run.contacts.items()}
    drawn = sorted(peaks, key=lambda name: -peaks[name])[:4]
    if len(drawn) < len(peaks):
        shown = f"{len(drawn)} of {len(peaks)} contacts are drawn, those with the largest pressures."
        yield element("p", shown)
    order = list(CAPTIONS)
    wanted = [one for one in pictures(run, case, Choice()) if one[0] in order]
    wanted = [one for one in wanted if one[0] not in OF_CONTACT or one[1] in drawn]
    with tempfile.TemporaryDirectory() as place, resolution(110):
        for kind, subject, make in sorted(wanted, key=lambda picture: order.index(picture[0])):
            try:
                file = write(Path(place) / f"{kind}.png", make())
            except RunError:
                # Not available in this run, as a force without loads.
                continue
            caption = text = CAPTIONS[kind].format(subject=subject)
            if kind == "bodies":
                text = f"{caption}, of bodies {', '.join(run.bodies)}"
            elif kind == "pressure":
                pressure, arc = run.contacts[subject].pressure[-1], run.contacts[subject].arc_length
                where = f" at arc length {arc[pressure.argmax()]:.4g}" if peaks[subject] > 0.0 else ""
                text = f"{caption}: at most {pressure.max(initial=0.0):.5g}{where}, at the end of the path"
            yield html.image(file.read_bytes(), text, caption)


def _compared(runs: Sequence[RunData], titles: Sequence[str]) -> str:
    """The keys that differ between the cases, and the main figures."""
    rows = collect([run.directory for run in runs])
    keys = [key for key in rows[0] if key not in ("directory", "stop_reason")]
    figures = [key for key in keys if key.startswith("contacts.") and key.endswith(MAIN)]
    last = keys.index("position") if "position" in keys else len(keys)
    varied = keys[keys.index("status") + 1 : last]
    # The files of very different cases are shown below.
    varied = varied if len(varied) <= 15 else []
    lines = []
    for key in (*varied, *(key for key in COMPARED if key in keys), *figures):
        # contacts.nose.reference.peak_pressure is nose: reference peak pressure.
        kind, name, words = (*key.split(".", 2), "", "")[:3]
        label = f"{name}: {words.replace('.', ' ').replace('_', ' ')}" if kind == "contacts" else key
        lines.append([label, *(_number(row[key]) for row in rows)])
    return html.table("The runs side by side", ["", *titles], lines)


def _number(value: Any) -> str:
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
