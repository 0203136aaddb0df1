"""Self-contained HTML pages: no other files, no scripts, readable without styles."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from mlsanm_cli import __version__
from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import write_text

_SIGNATURE = '<meta name="generator" content="mlsanm '
BAD, GOOD = "\x01", "\x02"
"""What coloured cells of tables begin with."""
_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff; margin: 0 auto;
  max-width: 62rem; padding: 1rem 1.25rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.25; } h2 { margin-top: 3rem; border-top: 1px solid #8c8c8c;
  padding-top: 1rem; } h3 { margin-top: 2rem; }
table { border-collapse: collapse; margin: 1rem 0; } caption { text-align: left; font-weight: 600;
  padding-bottom: .3rem; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #d0d0d0;
  vertical-align: top; font-variant-numeric: tabular-nums; } thead th { border-bottom-color: #1c1c1c; }
tbody th { font-weight: 400; }
.wide { overflow-x: auto; } figure { margin: 1.5rem 0; } img { max-width: 100%; height: auto; }
figcaption { font-size: .95rem; color: #444; }
pre { background: #f4f4f4; padding: 1rem; overflow-x: auto; font-size: .85rem; }
.bad { color: #a30000; font-weight: 600; } .good { color: #0b5d1e; } a { color: #004b87; }
@media print { body { max-width: none; } figure, table { break-inside: avoid; } }
"""


def write_page(path: Path, title: str, body: str) -> None:
    """Writes a page, replacing an earlier one of mlsanm. Raises RunError for other files and full disks."""
    if path.exists() and not is_ours(path):
        raise RunError(f"{path} is not a report of mlsanm", "no file was changed; use another -o, or move it")
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'{_SIGNATURE}{__version__}">\n<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n'
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )
    write_text(path, text)


def is_ours(path: Path) -> bool:
    """Whether a file is a page written by mlsanm."""
    return path.is_file() and _SIGNATURE.encode() in path.read_bytes()[:1000]


def element(tag: str, text: str, **attributes: str) -> str:
    """An element with a text, and attributes that are not empty; ``kind`` is its class."""
    return _around(tag, escape(text), **attributes)


def _around(tag: str, content: str, **attributes: str) -> str:
    attributes = {"class" if name == "kind" else name: value for name, value in attributes.items()}
    listed = "".join(f' {name}="{escape(value)}"' for name, value in attributes.items() if value)
    return f"<{tag}{listed}>{content}</{tag}>"


def listing(texts: Sequence[str]) -> str:
    return _around("ul", "".join(element("li", text) for text in texts))


def links(title: str, entries: Sequence[tuple[str, str]]) -> str:
    """A table of contents: anchors and texts of headings."""
    items = "".join(_around("li", element("a", text, href=f"#{name}")) for name, text in entries)
    return _around("nav", _around("ul", items), **{"aria-label": title})


def table(caption: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose first column names its rows; cells that begin with BAD or GOOD are coloured."""
    head = "".join(element("th", column, scope="col") for column in columns)
    cells = (element("th", first, scope="row") + "".join(map(_cell, rest)) for first, *rest in rows)
    lines = [_around("tr", row) for row in cells]
    shown = _around("thead", _around("tr", head)) if any(columns) else ""
    body = element("caption", caption) + shown + _around("tbody", "".join(lines))
    return _around("div", _around("table", body), kind="wide")


def image(png: bytes, description: str, caption: str) -> str:
    """An embedded picture; ``description`` is its alternative text."""
    data = base64.b64encode(png).decode()
    shown = f'<img alt="{escape(description)}" src="data:image/png;base64,{data}">'
    return _around("figure", shown + element("figcaption", caption))


def source(text: str, label: str) -> str:
    """Preformatted text, which can be scrolled with the keyboard."""
    return element("pre", text, tabindex="0", role="region", **{"aria-label": label})


def _cell(text: str) -> str:
    kind = {BAD: "bad", GOOD: "good"}.get(text[:1], "")
    return element("td", text[1:] if kind else text, kind=kind)
