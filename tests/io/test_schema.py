"""The tables of quantities agree with docs/run-directory.md."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import pytest

from mlsanm_cli.io import schema

PAGE = (Path(__file__).parents[2] / "docs" / "run-directory.md").read_text(encoding="utf-8")


def without_names(path: str) -> str:
    """A path with * for every name that the case gives."""
    return re.sub(r"<[^>]+>|\{\w+\}", "*", path)


def alternatives(cell: str) -> list[str]:
    """The paths of a cell, with {a, b} written out."""
    parts = re.split(r"\{([^}]*)\}", cell)
    choices = [part.split(", ") if number % 2 else [part] for number, part in enumerate(parts)]
    return ["".join(chosen) for chosen in product(*choices)]


def rows_of(title: str) -> list[list[str]]:
    """The cells of the table below a heading of the page."""
    section = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def test_datasets_are_those_of_the_page() -> None:
    told = {}
    for cell, shape, *_ in rows_of("`run.h5`"):
        for path in (one for text in re.findall(r"`/([^`]+)`", cell) for one in alternatives(text)):
            told[re.sub(r"(checkpoint/(last|path))/.*", r"\1/*", without_names(path))] = shape
    declared = {without_names(one.path): one for one in schema.RUN_FILE}
    assert declared.keys() == told.keys()
    for path, entry in declared.items():
        shapes = set(re.findall(r"\(([^)]*)\)", told.get(path, "")))
        ranks = {len([axis for axis in shape.split(",") if axis.strip()]) for shape in shapes}
        assert not ranks or "..." in told[path] or len(entry.dimensions) in ranks, path


@pytest.mark.parametrize("name", sorted({one.path.split(".")[0] for one in schema.SUMMARY}))
def test_summary_keys_are_on_the_page(name: str) -> None:
    cells = [cell for cell, *_ in rows_of("`summary.json`")]
    assert any(f"`{name}`" in cell for cell in cells)


def test_every_key_of_the_page_is_a_summary_key() -> None:
    told = {name for cell, *_ in rows_of("`summary.json`") for name in re.findall(r"`(\w+)`", cell)}
    assert told == {one.path.split(".")[0] for one in schema.SUMMARY}


def test_columns_and_arrays_are_on_the_page() -> None:
    words = re.sub(r"[_`]", " ", PAGE)
    fields = [one.name for one in schema.FIELDS]
    arrays = (*schema.INTERFACE_COLUMNS, *fields, "boundary_tag", *schema.CONTACT_ARRAYS)
    columns = [one.path.split(".")[-1] for one in schema.PATH_COLUMNS if not one.path.endswith("}")]
    for name in (*columns, *arrays):
        assert name.replace("_", " ").removesuffix(" 1").removesuffix(" 2") in words
