"""The tutorial's commands run, messages of the troubleshooting page are those of the program."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli import __version__
from mlsanm_cli.cli import main
from tests.app.test_documents import blocks

ROOT = Path(__file__).parents[2]
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
TROUBLE = (ROOT / "docs" / "troubleshooting.md").read_text()
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text()


def summary(place: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((Path("results") / place / "summary.json").read_text())
    return found


def test_every_command_of_the_tutorial_runs(
    tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    afterwards.chdir(tmp_path)
    first, more = blocks(TUTORIAL, "toml")
    (tmp_path / "clamp.toml").write_text(first)
    (tmp_path / "pulled.toml").write_text(first + more)
    lines = "".join(blocks(TUTORIAL, "sh")).splitlines()
    assert {line.split()[1] for line in lines} >= {"check", "run", "plot", "probe", "sweep", "report"}
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "mlsanm"
        if "pulled.toml" in words and "results/slipped" not in words:
            # Nothing is said of the figures of these, and histories on finer grids take a multiple.
            words += ["--set", "contact.foot.accuracy=0.05"]
        assert main([*words, "--quiet"] if words[0] == "run" else words) == 0, line
    # What the page says of the results.
    coarse, fine = summary("clamp")["contacts"]["foot"], summary("fine")["contacts"]["foot"]
    assert fine["peak_pressure"] == pytest.approx(coarse["peak_pressure"], rel=1e-3)
    assert summary("clamp")["error_estimate"]["pressure"]["foot"] is not None
    assert summary("slipped")["stopped_at"] == pytest.approx(1.73, abs=0.01)
    for picture in ("model.png", "depth.png", "traction.png", "work.png", "friction.png", "clamp.html"):
        assert (tmp_path / picture).stat().st_size > 5000
    assert summary("clamp")["warnings"] == summary("pulled")["warnings"] == []


def test_messages_of_the_page_are_those_of_the_program() -> None:
    sources = "\n".join(path.read_text() for path in (ROOT / "mlsanm_cli").rglob("*.py"))
    messages = re.findall(r"^\| `([^`]+)` \|", TROUBLE, flags=re.MULTILINE)
    assert len(messages) > 25
    for message in messages:
        for part in message.split(" ... "):
            assert part.strip() in sources, message


def test_pages_lead_to_places_that_are_there() -> None:
    """Links of the documents: files, and headings in them."""

    def names(path: Path) -> set[str]:
        heads = re.findall(r"^#+ (.*)$", path.read_text(), flags=re.MULTILINE)
        return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}

    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")):
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
            if link.startswith("http"):
                continue
            file, _, head = link.partition("#")
            target = (page.parent / file).resolve() if file else page
            assert target.exists(), f"{page.name}: {link}"
            assert not head or head in names(target), f"{page.name}: {link}"


def test_the_glossary_is_in_order_and_the_citation_is_of_this_version() -> None:
    words = [word.lower() for word in re.findall(r"^\| (\w[^|]*?) \|", GLOSSARY, flags=re.MULTILINE)][1:]
    assert words == sorted(words, key=lambda word: word.replace("é", "e"))
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"version: {__version__}\n" in citation
