"""``mlsanm sweep``: a case solved for all combinations of given values, each in its own run directory. Points
of one geometry are consecutive, so that a process can reuse their operators."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from mlsanm_cli.app.context import Console
from mlsanm_cli.app.results.info import collect, write_rows
from mlsanm_cli.app.run import RESULTS
from mlsanm_cli.app.scene.outlines import load_with_files
from mlsanm_cli.app.sweep.engines import SweepPoint, solve_points
from mlsanm_cli.case import Case, resolved_mapping
from mlsanm_cli.case.reading.overrides import parse_vary, points
from mlsanm_cli.errors import CaseError, CaseProblem, RunError
from mlsanm_cli.io import run_dir
from mlsanm_cli.io.run_reader import finished, held_case
from mlsanm_cli.memo import digest

TABLE_FILE = "sweep.csv"
RESULTS_PER_BODY = 4
"""A process keeps so many results of each kind for each body of a scene."""
MAX_NAME_LENGTH = 120
"""Longest name of a run directory, made of the values; longer ones end with a digest."""


def sweep(
    case_path: Path,
    varied: Sequence[str],
    *,
    overrides: tuple[str, ...] = (),
    out: Path | None = None,
    jobs: int = 1,
    threads: int = 1,
    scheduler: str | None = None,
    force: bool = False,
    console: Console,
    argv: tuple[str, ...] = (),
) -> Mapping[str, Any]:
    """Solve every point that is not completed yet, and write ``sweep.csv`` with a row for each.

    ``varied`` are KEY=VALUES texts; points are solved by ``jobs`` local processes, or by the Dask cluster at
    ``scheduler``; ``force`` repeats completed points. Returns the numbers of points completed, skipped as
    completed before, failed, and stopped or not begun, and a row for each point that did not end well.
    Raises CaseError or RunError, before any run, if a point is invalid, or if a directory holds a run of
    another case and ``force`` is not set.
    """
    if not varied:
        raise RunError("nothing varies", "name a key and its values, as in --vary solver.order=10,20")
    directory = (out or RESULTS / f"{case_path.stem}-sweep").absolute()
    planned = _plan(
        case_path.absolute(), varied, overrides, directory, force=force, threads=threads, argv=argv
    )
    todo = [point for group in planned for point in group if not point.done]
    total = sum(map(len, planned))
    if len(todo) < total:
        console.note(f"{total - len(todo)} of {total} points are done already")
    rows: list[Mapping[str, Any]] = []
    if todo:
        try:
            for row in solve_points(todo, jobs, scheduler):
                rows.append(row)
                count = row["warnings"]
                warned = f", {count} warning{'s' if count > 1 else ''}" if count else ""
                reason = f": {row['stop_reason']}" if row["status"] != "done" else ""
                console.note(f"{len(rows)}/{len(todo)} {row['name']} {row['status']}{warned}{reason}")
        except KeyboardInterrupt:
            console.warning("stopped by a signal; repeat the command to continue with the remaining points")
    table = directory / TABLE_FILE
    write_rows(table, collect([point.directory for group in planned for point in group]))
    statuses = [row["status"] for row in rows]
    return {
        "directory": str(directory),
        "table": str(table),
        "directories": [str(point.directory) for group in planned for point in group],
        "points": total,
        "done": statuses.count("done"),
        "skipped": total - len(todo),
        "failed": statuses.count("failed"),
        "stopped": len(todo) - statuses.count("done") - statuses.count("failed"),
        "with_warnings": sum(row["warnings"] > 0 for row in rows),
        "trouble": [row for row in rows if row["status"] != "done"],
    }


def _plan(
    case_path: Path,
    varied: Sequence[str],
    overrides: tuple[str, ...],
    directory: Path,
    *,
    force: bool,
    threads: int,
    argv: tuple[str, ...],
) -> list[list[SweepPoint]]:
    """All points, checked, in groups of one geometry each."""
    found: list[tuple[str, SweepPoint]] = []
    problems: dict[str, Any] = {}
    for values in points([parse_vary(text) for text in varied]):
        try:
            loaded = load_with_files(case_path, (*overrides, *values))
        except CaseError as error:
            named = [_named(problem, values) for problem in error.problems]
            problems |= {str(problem): problem for problem in named}
            continue
        place = directory / point_name(values)
        done = not force and finished(place, loaded.case_hash) is not None
        other = None if done or force else held_case(place)
        if other not in (None, loaded.case_hash):
            hint = "use --force to replace it, or another --out"
            raise RunError(f"{place} holds the run of another case", hint)
        if other is None and not done and not force:
            run_dir.check(place, force=False)
        point = SweepPoint(
            case=case_path,
            overrides=(*overrides, *values),
            directory=place,
            name=place.name,
            threads=threads,
            # Clouds, operators and responses of two geometries.
            memory=RESULTS_PER_BODY * len(loaded.case.body),
            argv=argv,
            done=done,
        )
        found.append((geometry(loaded.case), point))
    if problems:
        raise CaseError(tuple(problems.values()))
    order = list(dict.fromkeys(key for key, _ in found))
    found.sort(key=lambda item: order.index(item[0]))
    return [[point for _, point in group] for _, group in groupby(found, key=lambda item: item[0])]


def _named(problem: CaseProblem, values: Sequence[str]) -> CaseProblem:
    """A problem reported with the value that varies."""
    texts = dict(text.split("=", 1) for text in values)
    key = next((key for key in texts if f"{problem.key}.".startswith(f"{key}.")), None)
    if problem.source != "--set" or key is None:
        return problem
    value, hint = texts[key].strip(), problem.hint
    if value.startswith("[[" if key != problem.key else "["):
        hint = f"values are listed without brackets: --vary {key}={value[1:-1].replace(' ', '')}"
    return replace(problem, source="--vary", hint=hint)


def point_name(values: Sequence[str]) -> str:
    """Directory name of a point: its values, independent of the order of the keys."""
    name = ",".join(run_dir.file_part(value) for value in sorted(values)).replace("%3D", "=")
    if len(name) <= MAX_NAME_LENGTH:
        return name
    return f"{name[:MAX_NAME_LENGTH]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def geometry(case: Case) -> str:
    """Key that is equal for cases with the same operators; it only determines the order of points."""
    content = resolved_mapping(case)
    contacts = [
        {key: value for key, value in contact.items() if key != "regularization"}
        | {"friction": contact["friction"] > 0.0}
        for contact in content.get("contact", [])
    ]
    return digest(*(content.get(key) for key in ("model", "material", "body", "support", "mls")), contacts)
