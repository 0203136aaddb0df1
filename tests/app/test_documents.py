"""What the documents promise: their commands and snippets run, their tables are complete."""

from __future__ import annotations

import re
import runpy
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
from click import Context

from mlsanm_cli import __version__
from mlsanm_cli.app.checks.check import LIMITS
from mlsanm_cli.app.comparison.compare import compare
from mlsanm_cli.app.comparison.methods import ETA_FACTOR, SAME_LAW_FACTOR, STICK_FACTOR
from mlsanm_cli.app.results import plot as plot_module
from mlsanm_cli.case import load_case, resolved_mapping
from mlsanm_cli.case.starters import kinds, starter
from mlsanm_cli.cli import main
from mlsanm_cli.cli.commands import cli
from mlsanm_cli.cli.main import BUG, STOPPED, USAGE
from tests.app.runs import summary_of
from tests.app.scenes import PATCH, Quiet, done

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
CASE_FILE = (ROOT / "docs" / "case-file.md").read_text()
RUN_DIRECTORY = (ROOT / "docs" / "run-directory.md").read_text()
COMPARED = (ROOT / "docs" / "methods-compared.md").read_text()
PICTURES = (ROOT / "docs" / "pictures.md").read_text()
TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
TROUBLE = (ROOT / "docs" / "troubleshooting.md").read_text()
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text()


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def test_the_reference_is_up_to_date() -> None:
    for script, written in (("update_case_file.py", CASE_FILE), ("update_checks.py", TROUBLE)):
        page = runpy.run_path(str(ROOT / "docs" / script))["page"]
        assert page() == written, f"python docs/{script}"


def test_the_two_commands(tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: Any) -> None:
    commands = [command.strip() for command in blocks(README, "sh")]
    assert commands == ["pip install . && mlsanm run cases/hertz.toml", "pip install '.[test]' && pytest"]
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    afterwards.chdir(tmp_path)
    assert main(commands[0].partition(" && mlsanm ")[2].split()) == 0
    peak = summary_of(Path("results/hertz"))["contacts"]["interface"]["peak_pressure"]
    capsys.readouterr()
    short, snippet = blocks(README, "python")
    exec(compile(short, "README.md", "exec"), {})
    assert "226.5" in capsys.readouterr().out
    exec(compile(snippet, "README.md", "exec"), {})
    assert f"peak pressure {peak:.6g} at" in capsys.readouterr().out
    for arguments in (["info", "results/hertz"], ["plot", "results/hertz"]):
        assert main(arguments) == 0
    assert Path("results/hertz/plot_bodies.png").is_file()
    assert main(["run", "cases/hertz.toml", "--out", "results/fine", "--set", "mls.degree=3"]) == 0
    # Frames of an animation are drawn alike, and two are enough.
    afterwards.setattr(plot_module, "FRAMES", 2)
    for line in "".join(blocks(PICTURES, "sh")).splitlines():
        assert main(line.split()[1:]) == 0, line
        assert Path(line.split()[-1]).stat().st_size > 5000


@pytest.mark.parametrize("document", [README, CASE_FILE], ids=["README", "case-file"])
def test_the_cases_shown(tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: Any, document: str) -> None:
    (text,) = blocks(document, "toml")
    (tmp_path / "shown.toml").write_text(text)
    afterwards.chdir(tmp_path)
    assert main(["check", "shown.toml"]) == 0
    assert main(["run", "shown.toml"]) == 0
    summary = summary_of(Path("results/shown"))
    if document is README:
        assert summary["forces"]["lug.clamp"] == pytest.approx([-500.0, 0.0], abs=1e-3)
    else:
        assert summary["position"] == 2.0
        assert summary["contacts"]["nose"]["reference"]["pressure_error_l2"] < 0.1


def test_the_complete_case_shows_the_defaults(tmp_path: Path) -> None:
    """Every key of the tables that may be left out is there, with its default."""
    (text,) = blocks(CASE_FILE, "toml")
    (tmp_path / "shown.toml").write_text(text)
    content = tomllib.loads(text)
    short = re.sub(r"\[(mls|adapt|solver|contact\.regularization)\]\n(?:[^\[\n]*\n|\n)*", "", text)
    (tmp_path / "short.toml").write_text(short)
    shown = resolved_mapping(load_case(tmp_path / "shown.toml").case)
    assert resolved_mapping(load_case(tmp_path / "short.toml").case) == shown
    for table in ("mls", "adapt", "solver", "output"):
        assert content[table].keys() == shown[table].keys()


def test_commands_and_exit_codes() -> None:
    for name in cli.list_commands(Context(cli)):
        assert f"`mlsanm {name}" in README
    for code in (0, USAGE, 3, BUG, STOPPED):
        assert re.search(rf"^\| {code} \|", README, flags=re.MULTILINE)


def test_the_gallery_shows_every_published_case() -> None:
    page = (ROOT / "docs" / "gallery.md").read_text()
    for case in (ROOT / "cases").glob("*.toml"):
        assert f"(../cases/{case.name})" in page, f"python benchmarks/gallery.py --only {case.stem}"
    targets = re.findall(r"\]\(([^)#:]+)\)", page)
    assert len(targets) >= 18
    for target in targets:
        assert (ROOT / "docs" / target).stat().st_size < 150_000


@pytest.mark.usefixtures("by_nodes")
def test_comparisons_are_documented(tmp_path: Path) -> None:
    (tmp_path / "patch.toml").write_text(PATCH)
    found = compare(tmp_path / "patch.toml", analytic=True, out=tmp_path / "out", console=Quiet())
    section = RUN_DIRECTORY[RUN_DIRECTORY.index("## `comparison.json`") :]
    for key in {*found, *(key for row in found["methods"] for key in row)} - {"directory"}:
        assert f"`{key}`" in section, key
    assert f"| {SAME_LAW_FACTOR:g} `solver.tolerance`" in COMPARED
    assert f"| {ETA_FACTOR:g} √eta + {STICK_FACTOR:g} `stick`" in COMPARED


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
    names = ("clamp", "fine", "slipped", "pulled")
    coarse, fine, slipped, pulled = (summary_of(Path("results") / name) for name in names)
    peaks = [one["contacts"]["foot"]["peak_pressure"] for one in (coarse, fine)]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-3)
    assert coarse["error_estimate"]["pressure"]["foot"] is not None
    assert slipped["stopped_at"] == pytest.approx(1.73, abs=0.01)
    for picture in ("model.png", "depth.png", "traction.png", "work.png", "friction.png", "clamp.html"):
        assert (tmp_path / picture).stat().st_size > 5000
    assert coarse["warnings"] == pulled["warnings"] == []


def test_messages_of_the_page_are_those_of_the_program() -> None:
    sources = "\n".join(path.read_text() for path in (ROOT / "mlsanm_cli").rglob("*.py"))
    messages = re.findall(r"^\| `([^`]+)` \|", TROUBLE, flags=re.MULTILINE)
    assert len(messages) > 15
    for message in (one for one in messages if one not in LIMITS):
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


@pytest.mark.parametrize("kind", kinds())
def test_every_starter_runs(kind: str, tmp_path: Path) -> None:
    summary = done(starter(kind), tmp_path / kind)
    assert not summary["warnings"]
    assert summary["nodes"] <= 7000
    for contact in summary["contacts"].values():
        if "reference" in contact:
            assert contact["reference"]["pressure_error_l2"] <= 0.05


def test_the_site_has_every_page_and_its_notebooks_run(
    tmp_path: Path, afterwards: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    site = (ROOT / "mkdocs.yml").read_text()
    for page in (ROOT / "docs").glob("*.md"):
        assert f" {page.name}\n" in site, page.name
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    afterwards.chdir(tmp_path)
    runpy.run_path(str(ROOT / "docs" / "notebooks" / "hertz.py"))
    assert "half-width by Hertz 0.0" in capsys.readouterr().out
    assert "notebooks/hertz.py" in site
