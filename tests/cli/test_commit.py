"""Wheels and source distributions: what goes into them, and the commit with the code."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from mlsanm_cli import __version__
from mlsanm_cli import commit as module
from mlsanm_cli.cli import main

ROOT = Path(__file__).parents[2]
PROJECT = """[project]
name = "mlsanm"
version = "1"
dynamic = ["readme"]
[project.urls]
Repository = "https://somewhere.org"
[tool.setuptools]
packages = ["mlsanm_cli"]
[tool.setuptools.package-data]
mlsanm_cli = ["commit.txt"]
"""


def git(directory: Path, *arguments: str) -> str:
    own = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    command = ["git", *own, *arguments]
    return subprocess.run(command, cwd=directory, check=True, capture_output=True, text=True).stdout.strip()


def build(directory: Path, *arguments: str) -> None:
    command = [sys.executable, "setup.py", "-q", *arguments]
    subprocess.run(command, cwd=directory, check=True, capture_output=True)


def test_the_files_of_wheels_exist() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    (package,) = settings["package-data"].items()
    for pattern in {*package[1], "py.typed"} - {module.FILE}:
        assert list((ROOT / package[0]).glob(pattern)), pattern


def test_what_is_built_tells_its_commit(tmp_path: Path) -> None:
    pytest.importorskip("setuptools")
    source = tmp_path / "source"
    (source / "mlsanm_cli").mkdir(parents=True)
    (source / "mlsanm_cli" / "__init__.py").write_text("")
    (source / "pyproject.toml").write_text(PROJECT)
    (source / "README.md").write_text("[a page](docs/a.md) ![a picture](docs/a.png) [b](https://b.org)\n")
    for name in ("setup.py", "MANIFEST.in"):
        shutil.copy(ROOT / name, source)
    carried = ("CHANGELOG.md", "cases/a.toml", "docs/a.md", "tests/data/a.inp", "benchmarks/results/a.json")
    for name in carried:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text("")
    shutil.copy(ROOT / "mlsanm_cli" / "commit.py", source / "mlsanm_cli")
    git(source, "init", "-q")
    git(source, "add", ".")
    git(source, "commit", "-qm", "first")
    revision = git(source, "rev-parse", "--short=12", "HEAD")
    build(source, "build_py", "--build-lib", str(tmp_path / "wheel"))
    assert (tmp_path / "wheel" / "mlsanm_cli" / "commit.txt").read_text() == f"{revision}\n"
    # A source distribution has no git; what is built of it tells the commit all the same.
    build(source, "sdist", "--dist-dir", str(tmp_path / "dist"))
    shutil.unpack_archive(next((tmp_path / "dist").iterdir()), tmp_path / "unpacked")
    unpacked = next((tmp_path / "unpacked").iterdir())
    assert [name for name in carried if not (unpacked / name).exists()] == []
    text = (unpacked / "PKG-INFO").read_text()
    for link in ("(https://somewhere.org/blob/main/docs/a.md)", "/raw/main/docs/a.png)", "(https://b.org)"):
        assert link in text
    build(unpacked, "build_py", "--build-lib", str(tmp_path / "again"))
    assert (tmp_path / "again" / "mlsanm_cli" / "commit.txt").read_text() == f"{revision}\n"
    assert not (source / "mlsanm_cli" / "commit.txt").exists()


def test_the_version_tells_the_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "package").mkdir()
    monkeypatch.setattr(module, "__file__", str(tmp_path / "package" / "commit.py"))
    for built, shown in (("", ""), ("abc123\n", " (abc123)")):
        module.commit.cache_clear()
        if built:
            (tmp_path / "package" / module.FILE).write_text(built)
        assert main(["--version"]) == 0
        assert capsys.readouterr().out == f"mlsanm, version {__version__}{shown}\n"
    module.commit.cache_clear()
