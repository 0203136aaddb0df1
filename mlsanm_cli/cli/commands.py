"""The group of commands and those on one scene. Each imports its dependencies when called, which keeps
``--help`` fast."""

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
from mlsanm_cli.cli.console import called
from mlsanm_cli.cli.results import FRICTION_KEYS, has_friction, run_text
from mlsanm_cli.cli.settings import Settings, of_app, print_result, print_tables, say

MODULES = {
    "authoring": ("explain", "new", "schema", "fit-law"),
    "batch": ("collect", "compare", "sweep"),
    "views": ("plot", "probe", "report"),
}
"""Modules of this package that define commands, imported when these are called."""
LAZY_COMMANDS = {name: module for module, names in MODULES.items() for name in names}

SECTIONS = {
    "One scene": ("new", "check", "run", "resume", "info", "plot", "probe", "report"),
    "Many runs": ("sweep", "collect", "compare"),
    "Reference": ("explain", "schema", "fit-law", "warmup"),
}
"""Commands in the order of the help."""


class Commands(click.Group):
    """The group of commands. Suggests similar names, and imports commands of other modules on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All names, in the order of the help."""
        return [name for names in SECTIONS.values() for name in names]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by section."""
        room = formatter.width - 6 - max(map(len, self.list_commands(ctx)))
        for title, names in SECTIONS.items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            with formatter.section(title):
                formatter.write_dl([(name, one.get_short_help_str(room)) for name, one in commands if one])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, or None."""
        if cmd_name in LAZY_COMMANDS:
            module = importlib.import_module(f"mlsanm_cli.cli.{LAZY_COMMANDS[cmd_name]}")
            command: click.Command = getattr(module, cmd_name.replace("-", "_"))
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
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_version,
    help="Show the version.",
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
    contacts = {
        name: {
            key: value for key, value in figures.items() if key not in FRICTION_KEYS or has_friction(figures)
        }
        for name, figures in result.get("contacts", {}).items()
    }
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
    threads = threads or _threads_of(rundir)
    return show_run(settings, called(settings, "run.resume", threads, rundir, max_wall=max_wall))


for _command in (run, check, info, warmup, resume):
    cli.add_command(_command)
_STATUS_CODES = {"failed": 3, "stopped": 75}


def show_run(settings: Settings, summary: Mapping[str, Any]) -> int:
    """Prints the result of a run and returns its exit code."""
    width = shutil.get_terminal_size((100, 24)).columns
    print_result(settings, summary, run_text(summary, settings.paints(sys.stdout), width))
    # A run without a state has nothing to draw.
    drawable = summary.get("position") is not None and "directory" in summary
    if drawable and not settings.quiet and not settings.json:
        say(settings, f"pictures: mlsanm plot {shlex.quote(str(summary['directory']))}")
    return _STATUS_CODES.get(str(summary.get("status")), 0)


def _threads_of(rundir: Path) -> int:
    """The number of threads of a run, from its first event: run.h5 cannot be read before it is set."""
    try:
        with (rundir / "events.jsonl").open(encoding="utf-8") as stream:
            return max(int(json.loads(stream.readline())["threads"]), 1)
    except (OSError, ValueError, KeyError, TypeError):
        # Problems of the directory are reported later, when it is read.
        return 1
