"""Hooks of the documentation site (mkdocs.yml): the front page is README.md, and links to files outside docs/
lead to the repository, whose address is ``project.urls.Repository`` of pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(\]\()([^)#:\s]+)")
"""Targets of relative links, up to their anchor."""


def repository() -> str:
    """The address of the repository."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        return str(tomllib.load(file)["project"]["urls"]["Repository"])


def on_config(config: Any) -> Any:
    """Give the site the address of the repository."""
    config["repo_url"] = repository()
    return config


def on_files(files: Any, config: Any) -> Any:
    """README.md becomes the front page."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    front = LINK.sub(lambda m: m[1] + (m[2].removeprefix("docs/") if m[2] != "docs/" else m[2]), text)
    files.append(File.generated(config, "index.md", content=front))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Let links to files that are not part of the site lead to the repository."""
    folder = PurePosixPath("docs", page.file.src_uri).parent
    here = PurePosixPath() if page.file.src_uri == "index.md" else folder

    def target(match: re.Match[str]) -> str:
        parts: list[str] = []
        for part in (here / match[2]).parts:
            parts = parts[:-1] if part == ".." else [*parts, part]
        path = "/".join(parts)
        if path.startswith("docs/") or (ROOT / "docs" / path).exists() or not (ROOT / path).exists():
            return match[0]
        return f"{match[1]}{repository()}/blob/main/{path}"

    return LINK.sub(target, markdown)
