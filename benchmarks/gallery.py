"""Every published case with its picture, its closed formula, its error and its time: docs/gallery.md.

    python benchmarks/gallery.py [--only CASE ...] [--keep DIR]

Takes every case in cases/ that has an entry in gallery.toml or a [reference], and names the others at
the end of the page. Each runs in a process of its own, on one thread with compiled kernels; its time is the
CPU time that its summary tells. With --only the figures of other cases are taken from docs/gallery.json,
where all are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.gallery_entries import REFERENCES, Entry, entries  # noqa: E402
from mlsanm_cli.io.run_reader import read_run  # noqa: E402

PAGE = ROOT / "docs" / "gallery.md"
FIGURES = ROOT / "docs" / "gallery.json"
PICTURES = ROOT / "docs" / "gallery"
WIDTH = 760
LARGEST = 150_000


def main() -> None:
    """Run the cases and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], metavar="CASE")
    parser.add_argument("--keep", type=Path, help="keep the run directories here")
    arguments = parser.parse_args()
    figures = json.loads(FIGURES.read_text()) if arguments.only and FIGURES.is_file() else {}
    PICTURES.mkdir(exist_ok=True)
    others = []
    with tempfile.TemporaryDirectory() as scratch:
        for file in sorted((ROOT / "cases").glob("*.toml")):
            entry = _entry(file)
            if entry is None:
                others.append(file.stem)
            elif file.stem in arguments.only or not arguments.only:
                figures[file.stem] = _solved(file, entry, (arguments.keep or Path(scratch)) / file.stem)
                print(file.stem, json.dumps(figures[file.stem]["errors"]), flush=True)
    figures = {name: figures[name] for name in sorted(figures) if (ROOT / "cases" / f"{name}.toml").is_file()}
    FIGURES.write_text(json.dumps(figures, indent=2) + "\n")
    PAGE.write_text(page(figures, others))


def _entry(file: Path) -> Entry | None:
    reference = tomllib.loads(file.read_text()).get("reference", {})
    return entries().get(file.stem, REFERENCES.get(reference.get("solution", "")))


def _solved(file: Path, entry: Entry, directory: Path) -> dict[str, Any]:
    """Run and draw a case, put its picture into docs, and return its figures."""
    _mlsanm("run", str(file), "--out", str(directory), "--force", "--quiet")
    _mlsanm("plot", str(directory))
    summary = json.loads((directory / "summary.json").read_text())
    run = read_run(directory)
    errors = entry.judge(run) if entry.judge else _of_summary(summary)
    case = tomllib.loads(file.read_text())
    laws = [contact.get("regularization", {}).get("law") for contact in case.get("contact", ())]
    compared = {"compared": _compared(file, directory)} if "hyperbolic" in laws else {}
    (drawn,) = sorted(directory.glob(f"plot_{entry.picture}*.png"))
    _shrink(drawn, PICTURES / f"{file.stem}.png")
    return {
        "title": case["title"],
        "formula": entry.formula,
        "errors": {name: float(error) for name, error in errors.items()},
        "nodes": summary["nodes"],
        "contact_unknowns": summary["contact_unknowns"],
        "steps": summary["steps"],
        "cpu_seconds": summary["seconds"]["total"],
        **compared,
    }


def _mlsanm(*arguments: str) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "mlsanm_cli", *arguments]
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)


def _compared(file: Path, directory: Path) -> list[dict[str, Any]]:
    """Counts and difference of power series and Newton-Raphson, by `mlsanm compare --newton`."""
    out = directory.with_name(f"{directory.name}_compared")
    options = ("--newton", "--levels", "2", "--no-picture", "--quiet", "--force")
    _mlsanm("compare", str(file), *options, "--out", str(out))
    table = json.loads((out / "comparison.json").read_text())["methods"]
    return [
        {
            "method": row["method"],
            "steps": row["steps"],
            "factorisations": row["sparse_factorizations"],
            "cpu_seconds": row["seconds_path"],
            "difference": max(row.get("difference", {"": 0.0}).values()),
        }
        for row in table
    ]


def _of_summary(summary: dict[str, Any]) -> dict[str, float]:
    (contact,) = summary["contacts"].values()
    reference = contact["reference"]
    errors = {
        "pressure, L2": reference["pressure_error_l2"],
        "peak": abs(contact["peak_pressure"] / reference["peak_pressure"] - 1.0),
    }
    if reference["solution"] == "hertz-line":
        errors["half-width at 1 % of the peak"] = abs(contact["half_width"] / reference["half_width"] - 1.0)
    return errors


def _shrink(source: Path, target: Path) -> None:
    """The picture with ``WIDTH`` pixels and a palette."""
    with Image.open(source) as picture:
        size = WIDTH, round(WIDTH * picture.height / picture.width)
        small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(128)
        small.save(target, optimize=True)
    if target.stat().st_size > LARGEST:
        raise SystemExit(f"{target} has {target.stat().st_size} bytes, more than {LARGEST}")


def page(figures: dict[str, Any], others: list[str]) -> str:
    """The page as Markdown."""
    lines = [
        "# Gallery",
        "",
        "Every published case against its closed formula, made by `benchmarks/gallery.py`. CPU times are of "
        "a busy machine, start of the program included; only their ratios mean something.",
        "",
        "| case | largest error | nodes | CPU s |",
        "|---|---|---|---|",
    ]
    for name, case in figures.items():
        worst = max(case["errors"], key=lambda key: case["errors"][key])
        lines.append(
            f"| [{name}](#{name}) | {_percent(case['errors'][worst])} ({worst}) | {case['nodes']:,} "
            f"| {case['cpu_seconds']:.1f} |"
        )
    for name, case in figures.items():
        errors = ", ".join(f"{key} {_percent(error)}" for key, error in case["errors"].items())
        lines += [
            "",
            f"## {name}",
            "",
            f"{case['title']}: [{name}.toml](../cases/{name}.toml)",
            "",
            f"![{case['title']}](gallery/{name}.png)",
            "",
            f"Checked against {case['formula']}.",
            "",
            f"Errors: {errors}. {case['nodes']:,} nodes, {case['contact_unknowns']} contact unknowns, "
            f"{case['steps']} steps.",
        ]
        if "compared" in case:
            lines += ["", f"`mlsanm compare cases/{name}.toml --newton`: {_methods(case['compared'])}"]
    if others:
        listed = ", ".join(f"[{name}.toml](../cases/{name}.toml)" for name in others)
        lines += ["", "## Cases without a closed formula", "", f"{listed}"]
    return "\n".join(lines) + "\n"


def _methods(compared: list[dict[str, Any]]) -> str:
    """Cost and agreement of power series and Newton-Raphson on the same equations."""
    costs = [
        f"{row['method']} {row['steps']} steps, {row['factorisations']} factorisations, "
        f"{row['cpu_seconds']:.1f} s"
        for row in compared
    ]
    difference = max(row["difference"] for row in compared)
    return f"{'; '.join(costs)}; states differ by {difference:.0e}."


def _percent(error: float) -> str:
    return f"{100.0 * error:.2g} %" if error >= 1e-6 else f"{error:.0e}"


if __name__ == "__main__":
    main()
