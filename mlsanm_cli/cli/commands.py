"""The group of commands, and those that solve cases; each imports its dependencies when called."""

from __future__ import annotations

import importlib
import json
import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from mlsanm_cli import __version__
from mlsanm_cli.cli import declare
from mlsanm_cli.cli.console import Settings, TerminalConsole, called, of_app, print_result, print_tables, say
from mlsanm_cli.cli.text import FRICTION_KEYS, as_json, comparison_text, has_friction, run_text
from mlsanm_cli.errors import RunError
from mlsanm_cli.inputs import results_of

MODULES = {"authoring": ("explain", "new", "schema", "fit-law"), "views": ("plot", "probe", "report")}
"""Modules of this package that define commands, imported when these are called."""
SECTIONS = {
    "One scene": ("new", "check", "run", "resume", "info", "plot", "probe", "report"),
    "Many runs": ("sweep", "collect", "compare"),
    "Reference": ("explain", "schema", "fit-law", "warmup"),
}
"""Commands in the order of the help."""


class Commands(click.Group):
    """The group of commands. Suggests similar names, and imports commands of other modules on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [name for names in SECTIONS.values() for name in names]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        room = formatter.width - 6 - max(map(len, self.list_commands(ctx)))
        for title, names in SECTIONS.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl([(name, one.get_short_help_str(room)) for name, one in commands if one])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        for module in [module for module, names in MODULES.items() if cmd_name in names]:
            commands = importlib.import_module(f"mlsanm_cli.cli.{module}")
            command: click.Command = getattr(commands, cmd_name.replace("-", "_"))
            return command
        return super().get_command(ctx, cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As in click, with a suggestion for an unknown name."""
        if args and self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            import difflib

            names = self.list_commands(ctx)
            near = difflib.get_close_matches(args[0], names, n=1)
            hint = f'Did you mean "{near[0]}"?' if near else f"Commands: {', '.join(names)}."
            if args[0].endswith(".toml"):
                hint = f'To solve a case: "mlsanm run {args[0]}".'
            ctx.fail(f'No such command "{args[0]}". {hint}')
        return super().resolve_command(ctx, args)


def _show_version(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    """Print version and commit, and exit."""
    if not wanted or context.resilient_parsing:
        return
    from mlsanm_cli.commit import commit

    built = f" ({commit()})" if commit() else ""
    click.echo(f"mlsanm, version {__version__}{built}")
    context.exit()


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@declare.option(
    "--version", "Show the version.", is_flag=True, is_eager=True, expose_value=False, callback=_show_version
)
def cli() -> None:
    """Solve frictional contact of elastic bodies in the plane by a mesh-free method.

    A case is a TOML file; a run writes HDF5, VTU and JSON files to a directory.
    """


@declare.command(
    declare.CASE_OR_STDIN,
    declare.SET,
    declare.file_option("--out", "Run directory.  [default: results/<case name>]"),
    declare.flag("force", "Overwrite an existing run."),
    declare.MAX_WALL,
    declare.flag("skip-done", "Skip if this case has already been run to completion."),
    declare.THREADS,
)
def run(settings: Settings, /, case: Path, **options: Any) -> int:
    """Solve CASE and write a run directory."""
    options["out"] = options["out"] or results_of(case)
    summary = called(settings, "run.run", options["threads"], case, argv=tuple(sys.argv), **options)
    if summary.get("skipped"):
        print_result(settings, summary, f"{summary['directory']}: already run to completion, skipped")
        return 0
    return show_run(settings, summary)


@declare.command(
    declare.CASE_OR_STDIN,
    declare.SET,
    declare.file_option("--write", "Write the model as VTU: boundaries, normals, contact pairs."),
    declare.file_option("--picture", "Draw the model: nodes, supports, loads, obstacles."),
    declare.THREADS,
)
def check(settings: Settings, /, case: Path, **options: Any) -> int:
    """Check CASE without solving it.

    Validates the case, places nodes, builds stencils and contact pairs, and estimates size and cost.
    """
    result = called(settings, "check.check", options["threads"], case, **options)
    # The warnings have been printed on stderr.
    print_tables(settings, result, {key: value for key, value in result.items() if key != "warnings"})
    return 0


@declare.command(declare.RUNDIR)
def info(settings: Settings, rundir: Path) -> int:
    """Show the summary of the run in RUNDIR."""
    result = of_app("results.info.info")(rundir)
    contacts = {}
    for name, figures in result.get("contacts", {}).items():
        omitted = () if has_friction(figures) else FRICTION_KEYS
        contacts[name] = {key: value for key, value in figures.items() if key not in omitted}
    print_tables(settings, result, {**result, "contacts": contacts})
    return 0


@declare.command(declare.THREADS)
def warmup(settings: Settings, threads: int) -> int:
    """Compile the kernels before the first run."""
    print_tables(settings, called(settings, "check.warmup", threads))
    return 0


@declare.command(
    declare.RUNDIR,
    declare.MAX_WALL,
    declare.count("--threads", "Number of threads.  [default: that of the run]", None),
)
def resume(settings: Settings, rundir: Path, max_wall: float | None, threads: int | None) -> int:
    """Continue the interrupted run in RUNDIR after its last saved step.

    The result agrees with that of an uninterrupted run to the tolerance of the solver.
    """
    try:
        # From the first event: run.h5 cannot be read before the number is set.
        with (rundir / "events.jsonl").open(encoding="utf-8") as stream:
            before = max(int(json.loads(stream.readline())["threads"]), 1)
    except (OSError, ValueError, KeyError, TypeError):
        # Problems of the directory are reported later, when it is read.
        before = 1
    return show_run(settings, called(settings, "run.resume", threads or before, rundir, max_wall=max_wall))


@declare.command(
    declare.CASE,
    declare.option(
        "--vary varied",
        "Values separated by commas, or START:STOP:COUNT. Repeatable: all combinations are solved.",
        metavar="KEY=VALUES",
        **declare.KEYS,
    ),
    declare.SET,
    declare.file_option("--out", "Directory of the runs.  [default: results/<case name>-sweep]"),
    declare.flag("force", "Solve completed points again and overwrite runs of other cases."),
    declare.count("--jobs", "Number of processes."),
    declare.option("--scheduler", "Solve on the Dask cluster of this scheduler.", metavar="ADDRESS"),
    declare.THREADS,
)
def sweep(settings: Settings, /, case: Path, varied: tuple[str, ...], **options: Any) -> int:
    """Solve CASE for all combinations of values.

    For instance --vary contact.interface.friction=0:0.5:11 or --vary body.block.spacing=0.1,0.2,0.4.
    Completed points are skipped: the same command continues an interrupted sweep.
    """
    function, argv = "sweep.sweep", tuple(sys.argv)
    result = called(settings, function, options["threads"], case, varied, argv=argv, **options)
    shown = {key: value for key, value in result.items() if key not in ("trouble", "directories")}
    print_tables(settings, result, shown)
    return 3 if result["failed"] else 75 if result["stopped"] else 0


@declare.command(declare.RUNDIRS, declare.file_option("--out", "Output file.  [default: stdout]"))
def collect(settings: Settings, rundirs: tuple[Path, ...], out: Path | None) -> int:
    """Write the results of several runs as a CSV table.

    One row per run: the parameters that differ, status and results.
    """
    rows = of_app("results.info.collect")(rundirs)
    lost = [row for row in rows if row["status"] == "unreadable"]
    if len(lost) == len(rows):
        reason = f"{lost[0]['directory']}: {lost[0]['stop_reason']}" if lost else "there are only files"
        raise RunError(f"no directory holds a run ({reason})", "name run directories, as in results/sweep/*")
    with TerminalConsole(sys.stderr, settings) as console:
        for row in lost:
            console.warning(f"{row['directory']}: {row['stop_reason']}")
    if out is not None:
        of_app("results.info.write_rows")(out, rows)
    if settings.json:
        say(settings, as_json({"runs": rows}))
    elif out is None:
        say(settings, of_app("results.info.as_csv")(rows), newline=False)
    return 0


@declare.command(
    declare.CASE,
    declare.flag("newton", "Newton-Raphson with the regularised law."),
    declare.flag("active-set", "Active-set method with the exact law."),
    declare.flag("analytic", "Errors relative to the [reference] of the case."),
    declare.count("--levels", "Load levels per stage to compare, in addition to those of the case.", 10),
    declare.option(
        "--tolerance",
        "Allowed difference between methods with the same law.  [default: 100 x solver.tolerance]",
        type=click.FloatRange(min=0.0, min_open=True),
    ),
    declare.count("--repeat", "Repetitions of every path; median times are reported."),
    declare.option("--picture/--no-picture", "Draw a work-precision diagram.  [default: draw]", default=True),
    declare.SET,
    declare.file_option("--out", "Directory of comparison.json.  [default: results/<case name>]"),
    declare.flag("force", "Overwrite an existing comparison."),
    declare.THREADS,
)
def compare(settings: Settings, /, case: Path, **options: Any) -> int:
    """Solve CASE by several methods and compare the results.

    The asymptotic numerical method (ANM: power series), the selected methods and that of CASE use the same
    operators. Exit code 1 if they disagree.
    """
    methods = tuple(name for name in ("newton", "active-set") if options.pop(name.replace("-", "_")))
    function, argv = "comparison.compare.compare", tuple(sys.argv)
    result = called(settings, function, options["threads"], case, methods=methods, argv=argv, **options)
    print_result(settings, result, comparison_text(result, settings.paints(sys.stdout)))
    return {"disagree": 1, "failed": 3}.get(str(result["status"]), 0)


for _command in (run, check, info, warmup, resume, sweep, collect, compare):
    cli.add_command(_command)


def show_run(settings: Settings, summary: Mapping[str, Any]) -> int:
    """Prints the result of a run and returns its exit code."""
    width = shutil.get_terminal_size((100, 24)).columns
    print_result(settings, summary, run_text(summary, settings.paints(sys.stdout), width))
    # A run without a state has nothing to draw.
    drawable = summary.get("position") is not None and "directory" in summary
    if drawable and not settings.quiet and not settings.json:
        say(settings, f"pictures: mlsanm plot {shlex.quote(str(summary['directory']))}")
    return {"failed": 3, "stopped": 75}.get(str(summary.get("status")), 0)
