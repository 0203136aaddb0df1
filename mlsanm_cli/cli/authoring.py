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

from mlsanm_cli.cli import declare
from mlsanm_cli.cli.console import Settings, print_result, say
from mlsanm_cli.cli.text import BOLD, grid, paint, table
from mlsanm_cli.errors import RunError
from mlsanm_cli.toml import plain

SCHEMA_LINE = "#:schema ./mlsanm.schema.json"
"""First line of a starter, by which editors find the schema written by `mlsanm schema`."""


@declare.command(
    click.argument("name", type=declare.FILE, required=False),
    declare.option(
        "--kind",
        "Kind of scene, see --list.",
        default="hertz",
        show_default=True,
        **declare.completed(declare.kinds),
    ),
    declare.option("--list listing", "List the kinds of scenes.", is_flag=True),
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
    declare.option("--law laws", "A law, repeatable.  [default: all laws of rubber]", multiple=True),
    declare.option(
        "--nu", "Poisson's ratio.", default=0.499, show_default=True, type=click.FloatRange(0.0, 0.4999)
    ),
    declare.file_option("--picture", "Draw the data and the laws."),
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
    fits = fit_law(data, laws or tuple(START), picture, nu)
    rows = [(fit.law, *(f"{100.0 * error:.2g} %" for error in fit.errors.values())) for fit in fits]
    shown = [grid("root mean square errors, of the largest stress", ("law", *fits[0].errors), rows)]
    shown += [
        f"warning: {one.law}: the stress falls with the stretch within the data ({', '.join(one.falling)})"
        for one in fits
        if one.falling
    ]
    keys = ("constants", "errors", "falling")
    result = {fit.law: {key: plain(getattr(fit, key)) for key in keys} for fit in fits}
    print_result(settings, {"laws": result, "best": fits[0].law}, "\n\n".join([*shown, fits[0].toml]))
    return 0


@declare.command(
    click.argument("key", required=False, default="", **declare.completed(declare.plain_keys)),
    declare.option("--all all_keys", "Print the reference of all keys as Markdown.", is_flag=True),
)
def explain(settings: Settings, key: str, all_keys: bool) -> int:
    """Explain a key of the case file.

    KEY is a dotted key, for instance body.refine.spacing. Without KEY, list the tables.
    """
    from mlsanm_cli.case import explain as reference

    if all_keys and key:
        raise RunError("--all explains every key", f"omit {key} or --all")
    explanations = reference.all_explanations() if all_keys else reference.explain(key)
    described = [entry._asdict() for entry in explanations]
    color = settings.paints(sys.stdout)
    if all_keys:
        text = "# Keys of the case file\n\nMade by `mlsanm explain --all`.\n"
        text += reference.sections(explanations, "##")
    else:
        text = "\n\n".join(_explanation(entry, color) for entry in described)
    print_result(settings, {"explanations": described}, text)
    return 0


def _explanation(entry: dict[str, Any], color: bool) -> str:
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)

    def wrapped(text: str, indent: int) -> list[str]:
        return textwrap.wrap(text, width, initial_indent=" " * indent, subsequent_indent=" " * indent)

    title = entry["place"] if entry["keys"] else f"{entry['key']}, under {entry['place']}"
    kinds = f" ({', '.join(entry['kinds'])})" if entry["kinds"] else ""
    lines = [paint(title, BOLD, color) + kinds, *wrapped(entry["meaning"], 2)]
    rows = [(name, entry[name]) for name in ("type", "unit", "allowed", "default", "example") if entry[name]]
    if entry["key"]:
        lines.append(table("", [*rows, ("required", "yes" if entry["required"] else "no")]))
    # Of the description of a key the first sentence, brackets in one piece.
    keys = {
        name: re.split(r"[.;:]\s(?![^()]*\))", text)[0].rstrip(".") for name, text in entry["keys"].items()
    }
    for heading, listed in (("kinds", entry["variants"]), ("keys", keys)):
        lines += [f"  {heading}"] if listed else []
        indent = max(map(len, listed), default=0) + 6
        for name, meaning in listed.items():
            first, *others = wrapped(meaning, indent)
            lines += [f"    {name}".ljust(indent) + first.lstrip(), *others]
    return "\n".join(lines)
