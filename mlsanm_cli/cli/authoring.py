"""Commands for writing a case: ``new``, ``schema``, ``explain``."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sys
import textwrap
from pathlib import Path
from typing import Any

import click

from mlsanm_cli.cli import completion, declare
from mlsanm_cli.cli.settings import Settings, print_result, say
from mlsanm_cli.cli.text import BOLD, grid, paint, table
from mlsanm_cli.errors import RunError

DEFAULT_KIND = "hertz"
SCHEMA_LINE = "#:schema ./mlsanm.schema.json"
"""First line of a starter, by which editors find the schema written by `mlsanm schema`."""


@declare.command(
    click.argument("name", type=declare.FILE, required=False),
    click.option(
        "--kind",
        default=DEFAULT_KIND,
        show_default=True,
        shell_complete=completion.kinds,
        help="Kind of scene, see --list.",
    ),
    click.option("--list", "listing", is_flag=True, help="List the kinds of scenes."),
    declare.flag("force", "Overwrite an existing file."),
)
def new(settings: Settings, name: Path | None, kind: str, listing: bool, force: bool) -> int:
    """Write a starter case to NAME.toml."""
    from mlsanm_cli.case.report import suggestion
    from mlsanm_cli.case.starters import kinds, starter

    known = kinds()
    if listing:
        print_result(settings, {"kinds": known}, table("", list(known.items())))
        return 0
    if name is None:
        raise RunError("no name given", "for example: mlsanm new punch --kind hertz")
    if kind not in known:
        raise RunError(f'there is no kind "{kind}"', suggestion(kind, known, "kinds"))
    file = name if name.suffix == ".toml" else name.with_name(f"{name.name}.toml")
    try:
        with file.open("w" if force else "x", encoding="utf-8") as stream:
            stream.write(f"{SCHEMA_LINE}\n{starter(kind)}")
    except FileExistsError as error:
        raise RunError(f"{file} already exists", "use --force to overwrite it, or another name") from error
    result = {"file": str(file), "kind": kind}
    quoted, keys = shlex.quote(str(file)), file.with_name("mlsanm.schema.json")
    steps = f"check: mlsanm check {quoted}\nsolve: mlsanm run {quoted}"
    editor = "" if keys.exists() else f"\nkeys in an editor: mlsanm schema > {shlex.quote(str(keys))}"
    print_result(settings, result, f"{file}\n{steps}{editor}")
    return 0


@declare.command()
def schema(settings: Settings) -> int:
    """Print the JSON Schema of case files, for editors."""
    from mlsanm_cli.case.schema import json_schema

    say(settings, json.dumps(json_schema(), indent=2))
    return 0


@declare.command(
    click.argument("data", type=declare.FILE),
    click.option("--law", "laws", multiple=True, help="A law, repeatable.  [default: all laws of rubber]"),
    click.option(
        "--nu", default=0.499, show_default=True, type=click.FloatRange(0.0, 0.4999), help="Poisson's ratio."
    ),
    declare.file_option("--picture", help="Draw the data and the laws."),
    declare.flag("force", "Overwrite an existing picture."),
)
def fit_law(
    settings: Settings, data: Path, laws: tuple[str, ...], nu: float, picture: Path | None, force: bool
) -> int:
    """Constants of laws of rubber from a CSV file with the columns test, stretch, stress.

    Tests are uniaxial, equibiaxial and planar, stresses nominal.
    """
    from mlsanm_cli.app.fit_law import START, fit_law
    from mlsanm_cli.case.report import suggestion

    for law in laws:
        if law not in START:
            raise RunError(f'there is no law of rubber "{law}"', suggestion(law, START, "laws"))
    if picture is not None and picture.exists() and not force:
        raise RunError(f"{picture} already exists", "use --force to overwrite it, or another name")
    found = fit_law(data, laws or tuple(START), picture, nu)
    rows = [(one.law, *(f"{100.0 * error:.2g} %" for error in one.errors.values())) for one in found]
    shown = [grid("root mean square errors, of the largest stress", ("law", *found[0].errors), rows)]
    warnings = [
        f"warning: {one.law}: the stress falls with the stretch within the data ({', '.join(one.falling)})"
        for one in found
        if one.falling
    ]
    shown += [*warnings, found[0].toml]
    result = {
        one.law: {"constants": dict(one.constants), "errors": dict(one.errors), "falling": list(one.falling)}
        for one in found
    }
    print_result(settings, {"laws": result, "best": found[0].law}, "\n\n".join(shown))
    return 0


@declare.command(
    click.argument("key", required=False, default="", shell_complete=completion.plain_keys),
    click.option("--all", "all_keys", is_flag=True, help="Print the reference of all keys as Markdown."),
)
def explain(settings: Settings, key: str, all_keys: bool) -> int:
    """Explain a key of the case file.

    KEY is a dotted key, for instance body.refine.spacing. Without KEY, list the tables.
    """
    if all_keys:
        from mlsanm_cli.case.explain import all_explanations, markdown

        if key:
            raise RunError("--all explains every key", f"omit {key} or --all")
        explanations = all_explanations()
        described = [entry._asdict() for entry in explanations]
        print_result(settings, {"explanations": described}, markdown(explanations))
        return 0
    from mlsanm_cli.case.explain import explain as explain_key

    described = [entry._asdict() for entry in explain_key(key)]
    color = settings.paints(sys.stdout)
    text = "\n\n".join(_explanation(entry, color) for entry in described)
    print_result(settings, {"explanations": described}, text)
    return 0


def _explanation(entry: dict[str, Any], color: bool) -> str:
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    title = entry["place"] if entry["keys"] else f"{entry['key']}, under {entry['place']}"
    kinds = f" ({', '.join(entry['kinds'])})" if entry["kinds"] else ""
    lines = [paint(title, BOLD, color) + kinds, *_wrapped(entry["meaning"], width, 2)]
    rows = [(name, entry[name]) for name in ("type", "unit", "allowed", "default", "example") if entry[name]]
    if entry["key"]:
        rows.append(("required", "yes" if entry["required"] else "no"))
        lines.append(table("", rows))
    for heading, listed in (("kinds", entry["variants"]), ("keys", entry["keys"])):
        if listed:
            lines.append(f"  {heading}")
            indent = max(map(len, listed)) + 6
            for name, meaning in listed.items():
                # The first sentence of the description of a key, brackets in one piece.
                meaning = (
                    meaning
                    if heading == "kinds"
                    else re.split(r"[.;:]\s(?![^()]*\))", meaning)[0].rstrip(".")
                )
                text = _wrapped(meaning, width, indent)
                lines += [f"    {name}".ljust(indent) + text[0].lstrip(), *text[1:]]
    return "\n".join(lines)


def _wrapped(text: str, width: int, indent: int) -> list[str]:
    space = " " * indent
    return textwrap.wrap(text, width, initial_indent=space, subsequent_indent=space)
