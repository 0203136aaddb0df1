"""What pyproject.toml cannot say: the commit that is built goes into wheels and source distributions, and
relative links of README.md lead to the repository on a package index."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

PACKAGE = "mlsanm_cli"


def write_commit(package: Path) -> None:
    """Write the commit of this source tree into a copy of the package, unless the tree has none."""
    source = Path(__file__).resolve().parent
    # By its path: the package itself needs what is not installed while it is built.
    spec = importlib.util.spec_from_file_location("commit", source / PACKAGE / "commit.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    commit = module.git_state(source)
    if commit:
        # Not through a link: sdist links files of the source tree.
        (package / module.FILE).unlink(missing_ok=True)
        (package / module.FILE).write_text(f"{commit}\n", encoding="utf-8")


def readme() -> str:
    """README.md, its relative links and pictures by the address of the repository."""
    source = Path(__file__).resolve().parent
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = (source / "README.md").read_text(encoding="utf-8")
    address = project["urls"]["Repository"]
    text = re.sub(r"(!\[[^\]]*\]\()(?![a-z]+:|#)", rf"\g<1>{address}/raw/main/", text)
    return re.sub(r"((?<!!)\[[^\]]*\]\()(?![a-z]+:|#)", rf"\g<1>{address}/blob/main/", text)


class BuildWithCommit(build_py):
    """Wheels."""

    def run(self) -> None:
        super().run()
        if not getattr(self, "editable_mode", False):
            write_commit(Path(self.build_lib) / PACKAGE)


class SdistWithCommit(sdist):
    """Source distributions."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        super().make_release_tree(base_dir, files)
        write_commit(Path(base_dir) / PACKAGE)


setup(
    cmdclass={"build_py": BuildWithCommit, "sdist": SdistWithCommit},
    long_description=readme(),
    long_description_content_type="text/markdown",
)
