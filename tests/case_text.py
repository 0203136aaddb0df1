"""Case files from their parts, one line of a test for each part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

EXACT = {"law": "exact"}


def head(plane: str, **model: Any) -> str:
    """How every case begins."""
    return f"format = 1\n{table('model', plane=plane, **model)}"


def table(name: str, /, **keys: Any) -> str:
    """A table with one key to a line: ``body_force`` stands for body-force, ``from_`` for from."""
    return f"[{name}]\n{_lines(keys)}"


def item(name: str, /, **keys: Any) -> str:
    """An item of a list of tables, likewise."""
    return f"[[{name}]]\n{_lines(keys)}"


def material(name: str, **keys: Any) -> str:
    return table(f"material.{name}", **keys)


def body(name: str, of: str, spacing: Any = None, shape: dict[str, Any] | None = None, **more: Any) -> str:
    """A body; what is None is left out, as where tables below follow."""
    return item("body", name=name, material=of, spacing=spacing, shape=shape, **more)


def box(x: Sequence[Any], y: Sequence[Any]) -> dict[str, Any]:
    """The shape of a rectangle."""
    return {"kind": "rectangle", "x": x, "y": y}


def disk(center: Sequence[Any], radius: Any) -> dict[str, Any]:
    return {"kind": "disk", "center": center, "radius": radius}


def annulus(center: Sequence[Any], radii: Sequence[Any]) -> dict[str, Any]:
    return {"kind": "annulus", "center": center, "radii": radii}


def half_disk(center: Sequence[Any], radius: Any, side: str = "lower") -> dict[str, Any]:
    return {"kind": "half-disk", "center": center, "radius": radius, "side": side}


def polygon(points: Sequence[Any], names: str) -> dict[str, Any]:
    """A polygon, its sides named by the words of ``names``."""
    return {"kind": "polygon", "points": points, "names": names.split()}


def plane(point: Sequence[Any], normal: Sequence[Any]) -> dict[str, Any]:
    """A flat obstacle."""
    return {"kind": "plane", "point": point, "normal": normal}


def support(boundary: Any, **keys: Any) -> str:
    return item("support", boundary=boundary, **keys)


def pin(of: str, near: Sequence[Any], **keys: Any) -> str:
    """A support at the node of a body that is nearest to a point."""
    return item("support", body=of, near=near, **keys)


def load(name: str, boundary: Any, kind: str, **keys: Any) -> str:
    return item("load", name=name, boundary=boundary, kind=kind, **keys)


def pushed(name: str, obstacle: str, **keys: Any) -> str:
    """A load on the obstacle of a contact."""
    return item("load", name=name, kind="obstacle", obstacle=obstacle, **keys)


def contact(name: str, slave: Any, master: Any = None, **keys: Any) -> str:
    return item("contact", name=name, slave=slave, master=master, **keys)


def _lines(keys: dict[str, Any]) -> str:
    others = {"body_force": "body-force", "from_": "from"}
    return "".join(
        f"{others.get(key, key)} = {_value(one)}\n" for key, one in keys.items() if one is not None
    )


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str | bool):
        return f'"{value}"' if isinstance(value, str) else str(value).lower()
    return _number(float(value)) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    """As people write it: 210e3, 1e-5."""
    digits, _, power = f"{value:e}".partition("e")
    text = (
        f"{value / 1e3}".removesuffix(".0") + "e3" if abs(value) >= 1e4 else f"{float(digits):g}e{int(power)}"
    )
    usual = value == 0.0 or 1e-3 <= abs(value) < 1e4 or abs(value) >= 1e7
    return repr(value) if usual or float(text) != value else text
