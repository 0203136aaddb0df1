"""What was measured, as a picture and as tables between two marks of a page. Knows only peers.json."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

Results = dict[str, list[dict[str, Any]]]
"""Parts and their points, as run.py writes them."""

TITLES = {
    "hertz": "Hertz",
    "levels": "Hertz, 50 levels",
    "slip": "partial slip",
    "history": "history, 60 levels",
    "patch": "patch test",
}
QUANTITIES = {
    "hertz": "pressure, one load level",
    "levels": "pressure, 50 load levels",
    "slip": "partial slip: traction's even part",
    "history": "traction after 60 levels",
}
LIMITS = {
    "hertz": (0.01, 0.003, 0.001),
    "levels": (0.01, 0.003),
    "slip": (0.025, 0.005),
    "history": (0.025, 0.005),
}
"""Errors at which the fastest are compared."""
OURS = "mlsanm"
GROUPS = {
    "": ("",),
    ", peers on even meshes": (", even",),
    ", peers that factorise in every iteration": (", sparse", ", Newton", "CalculiX"),
}
"""The peers compared with, by how their names end: all, and some of them."""
GIVEN, GEOMETRY = "given", "geometry"
WAYS = {GIVEN: "mesh given", GEOMETRY: "from geometry"}
START, END = "<!-- written by benchmarks/peers/run.py -->", "<!-- end of what run.py writes -->"
EXACT = 1e-7
"""A smaller error is called round-off: the patch test leaves nothing else."""


def row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def header(*cells: str) -> Iterator[str]:
    yield row(*cells)
    yield "|" + "---|" * len(cells)


def per_cent(error: float) -> str:
    """Two digits, as no more of them mean anything."""
    return "round-off" if error < EXACT else f"{100.0 * error:.2g} %"


def seconds(point: dict[str, Any], way: str, usual: int) -> str:
    """Median, and the number of turns where it is not the usual one."""
    if way not in point:
        return "-"
    turns = point[way]["turns"]
    return f"{point[way]['cpu_seconds']:.2f}" + (f" ({turns})" if turns != usual else "")


def entries(results: Results) -> Iterator[str]:
    """The table of all that was run. Turns in brackets where they are not those of most."""
    turns = [point[GEOMETRY]["turns"] for points in results.values() for point in points if GEOMETRY in point]
    usual = max(set(turns), key=turns.count, default=0)
    yield f"Medians of {usual} turns, of fewer where a number stands in brackets."
    yield ""
    yield from header(
        "problem",
        "program",
        "mesh or cloud",
        "vertices or nodes",
        *(f"CPU, {name} [s]" for name in WAYS.values()),
        "error",
    )
    for part, title in TITLES.items():
        for point in results.get(part, []):
            if point.get("failed"):
                yield row(title, point["program"], point["label"], "", "failed", "failed", "")
                continue
            times = (seconds(point, way, usual) for way in WAYS)
            name, label, nodes = point["program"], point["label"], str(point["nodes"])
            yield row(title, name, label, nodes, *times, per_cent(point["error"]))


def fastest(points: list[dict[str, Any]], way: str, limit: float) -> dict[str, Any] | None:
    """Of the points with no larger error the one with the smallest time."""
    good = [point for point in points if way in point and point["error"] <= limit]
    return min(good, key=lambda point: float(point[way]["cpu_seconds"]), default=None)


def verdicts(results: Results) -> Iterator[str]:
    """The table of the fastest: mlsanm, and the peers with their mesh given and from the geometry on."""
    yield from header(
        "problem",
        "error at most",
        "mlsanm [s]",
        *(f"fastest peer, {name} [s]" for name in WAYS.values()),
        *(f"mlsanm / peer, {name}" for name in WAYS.values()),
    )
    for part, limits in LIMITS.items():
        points = results.get(part, [])
        ours = [point for point in points if point["program"] == OURS]
        others = [point for point in points if point["program"] != OURS]
        for which, ends in GROUPS.items():
            group = [point for point in others if point["program"].endswith(ends)]
            for limit in limits if group else ():
                mine = fastest(ours, GEOMETRY, limit)
                best = [(way, fastest(group, way, limit)) for way in WAYS]
                told = [
                    f"{peer[way]['cpu_seconds']:.2f} ({peer['program']}, {peer['label']})" if peer else "none"
                    for way, peer in best
                ]
                ratios = [
                    f"{mine[GEOMETRY]['cpu_seconds'] / peer[way]['cpu_seconds']:.2f}"
                    if mine and peer
                    else "-"
                    for way, peer in best
                ]
                own = f"{mine[GEOMETRY]['cpu_seconds']:.2f} ({mine['label']})" if mine else "none"
                yield row(TITLES[part] + which, f"{100 * limit:g} %", own, *told, *ratios)


def tables(results: Results) -> str:
    """Both tables in Markdown."""
    return "\n".join([*verdicts(results), "", *entries(results)])


def insert(page: str, text: str) -> str:
    """The page with ``text`` between its marks in place of what stood there.

    Raises ValueError if the page has not both marks.
    """
    before, start, rest = page.partition(START)
    _, end, after = rest.partition(END)
    if not (start and end):
        raise ValueError(f"the page lacks {START!r} or {END!r}")
    return f"{before}{START}\n\n{text}\n\n{END}{after}"


def draw(path: Path, results: Results) -> None:
    """Error against time for every part that has errors worth drawing; meshes given: open marks."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    shown = [part for part in QUANTITIES if part in results]
    figure = Figure(figsize=(4.2 * len(shown), 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    programs = sorted({point["program"] for part in shown for point in results[part]})
    for axes, part in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        for number, program in enumerate(programs):
            for way, face in ((GIVEN, "none"), (GEOMETRY, f"C{number}")):
                points = sorted(
                    (point[way]["cpu_seconds"], 100 * point["error"])
                    for point in results[part]
                    if point["program"] == program and way in point
                )
                if points:
                    label = program if way == GEOMETRY else None
                    marks = {"marker": "osDP^vX*"[number % 8], "color": f"C{number}", "mfc": face}
                    axes.loglog(*zip(*points, strict=True), linestyle="", label=label, **marks)
        axes.set(title=QUANTITIES[part], xlabel="CPU seconds of the whole process", ylabel="error, L2 [%]")
        axes.grid(which="both", alpha=0.3)
        for axis in (axes.xaxis, axes.yaxis):  # less than a decade may be shown, which needs more ticks
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())
    drawn = {str(line.get_label()): line for axes in figure.axes for line in axes.get_lines()}
    named = [program for program in programs if program in drawn]
    title = "filled: from the geometry on; open: mesh given"
    handles = [drawn[program] for program in named]
    figure.legend(handles, named, title=title, loc="outside lower center", ncols=5)
    figure.savefig(path, dpi=110)
