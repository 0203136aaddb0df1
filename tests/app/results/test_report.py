"""``mlsanm report``: one HTML file, valid, small, readable without a server, a script or eyes."""

from __future__ import annotations

import base64
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.results.report import report
from mlsanm_cli.app.run import run as run_case
from mlsanm_cli.cli import main
from mlsanm_cli.errors import RunError
from tests.app.scenes import ANM, BAR, FAST, Quiet, hertz, solve

VOID = {"meta", "img", "br", "link"}


class Reader(HTMLParser):
    """Checks that elements are closed in order, and keeps what a test asks for."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def read(path: Path) -> Reader:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader


def assert_accessible(page: Reader) -> None:
    assert page.of("html")[0]["lang"] == "en"
    assert page.of("title")
    assert len(page.of("h1")) == len(page.of("main")) == 1
    assert all(image["alt"] for image in page.of("img"))
    assert all(cell["scope"] in ("row", "col") for cell in page.of("th"))
    assert len(page.of("caption")) == len(page.of("table"))
    levels = [int(tag[1]) for tag, _ in page.elements if tag in ("h1", "h2", "h3")]
    assert all(after <= before + 1 for before, after in pairwise(levels))
    names = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(names) == len(set(names))
    assert all((link["href"] or "").removeprefix("#") in names for link in page.of("a"))


def assert_alone(page: Reader, path: Path) -> None:
    """Nothing is loaded from anywhere, and nothing runs."""
    assert not page.of("script")
    assert not page.of("link")
    assert all((image["src"] or "").startswith("data:image/png;base64,") for image in page.of("img"))
    assert "http" not in path.read_text().replace("data:image", "")
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)


def test_two_runs_in_one_small_file(punches_run: Path, bar_run: Path, tmp_path: Path) -> None:
    path = report([punches_run, bar_run], tmp_path / "all.html")
    assert path.stat().st_size < 3e6
    page = read(path)
    assert_accessible(page)
    assert_alone(page, path)
    assert len(page.of("img")) == 5 + 2
    for image in page.of("img"):
        data = base64.b64decode((image["src"] or "").partition(",")[2])
        assert data.startswith(b"\x89PNG")
    text = " ".join(page.text)
    provenance = ("side by side", "Provenance", "under-left: peak pressure", "energy error", "passes")
    for words in ("2 runs", "[[load]]", *provenance):
        assert words in text


def test_a_run_has_its_report_beside_it_and_loses_it_with_force(tmp_path: Path) -> None:
    solve(hertz().table("units", stress="MPa"), tmp_path / "run", FAST)
    path = report([tmp_path / "run"])
    assert path == tmp_path / "run" / "report.html"
    page = read(path)
    assert_accessible(page)
    text = " ".join(page.text)
    assert "peak pressure [MPa]" in text
    assert "hertz-line" in text
    short = ("solver.max_steps=1", ANM)
    run_case(tmp_path / "run.toml", overrides=short, out=tmp_path / "run", force=True, console=Quiet())
    assert not path.exists()


def test_what_stands_in_a_case_is_no_html(tmp_path: Path) -> None:
    text = BAR.changed("format = 1", 'format = 1\ntitle = "<b onclick=alert(1)>&amp;</b>"', 1)
    solve(text, tmp_path / "run")
    page = read(report([tmp_path / "run"]))
    assert not page.of("b")
    assert "<b onclick=alert(1)>&amp;</b>" in " ".join(page.text)


def test_a_failed_run_says_so(tmp_path: Path) -> None:
    summary = solve(hertz(), tmp_path / "run", "solver.max_steps=2", ANM)
    assert summary["status"] == "failed"
    page = read(report([tmp_path / "run"]))
    assert_accessible(page)
    assert any(attributes.get("class") == "bad" for attributes in page.of("p"))
    assert "max steps" in " ".join(page.text)


def test_foreign_files_are_left_alone(bar_run: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.html"
    mine.write_text("<p>my own</p>")
    with pytest.raises(RunError, match="not a report of mlsanm"):
        report([bar_run], mine)
    assert mine.read_text() == "<p>my own</p>"
    with pytest.raises(RunError, match=r"ends in \.html"):
        report([bar_run], tmp_path / "report.pdf")


def test_the_command(bar_run: Path, tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: Any) -> None:
    afterwards.chdir(tmp_path)
    for _ in range(2):
        # One of its own is replaced.
        assert main(["report", str(bar_run), "-o", "bar.html"]) == 0
        assert capsys.readouterr().out == "bar.html\n"
    assert main(["report", str(bar_run), str(bar_run)]) == 0
    assert (tmp_path / "report.html").is_file()
    assert main(["report", "nowhere"]) == 2
