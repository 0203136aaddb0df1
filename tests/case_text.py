"""Case files from their parts, one line of a test for each part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

EXACT = {"law": "exact"}


class Scene(str):
    """The text of a case; every method returns it with one part more.

    What is None is left out. A shape or an obstacle is given by its kind: ``box=(x, y)``,
    ``disk=(center, radius)``, ``annulus=(center, radii)``, ``half_disk=(center, radius)``,
    ``polygon=(points, names)``, ``polyline=points``, ``plane=(point, normal)``.
    """

    __slots__ = ()

    def add(self, *texts: str) -> Scene:
        return Scene("".join((self, *texts)))

    def __add__(self, other: str) -> Scene:
        return self.add(other)

    def changed(self, old: str, new: str, count: int = -1) -> Scene:
        """Another text in the place of one that has to be there."""
        assert old in self, old
        return Scene(self.replace(old, new, count))

    def table(self, name: str, /, **keys: Any) -> Scene:
        """A table with one key to a line: ``body_force`` stands for body-force, ``from_`` for from."""
        return self.add(f"[{name}]\n{_lines(keys)}")

    def item(self, name: str, /, **keys: Any) -> Scene:
        """An item of a list of tables, likewise."""
        return self.add(f"[[{name}]]\n{_lines(keys)}")

    def material(self, name: str, **keys: Any) -> Scene:
        return self.table(f"material.{name}", **keys)

    def body(
        self, name: str, of: str, spacing: Any = None, shape: Any = None, *, clamped: str = "", **more: Any
    ) -> Scene:
        """A body, held in both directions along the side that is ``clamped``."""
        keys = {"spacing": spacing, "shape": shape} | _with_shape("shape", more)
        text = self.item("body", name=name, material=of, **keys)
        return text.support(f"{name}.{clamped}", ux=0.0, uy=0.0) if clamped else text

    def support(self, boundary: Any, **keys: Any) -> Scene:
        return self.item("support", boundary=boundary, **keys)

    def pin(self, of: str, near: Sequence[Any], **keys: Any) -> Scene:
        """A support at the node of a body that is nearest to a point."""
        return self.item("support", body=of, near=near, **keys)

    def load(self, name: str, boundary: Any, kind: str, **keys: Any) -> Scene:
        return self.item("load", name=name, boundary=boundary, kind=kind, **keys)

    def body_force(self, name: str, of: str, force: Sequence[Any]) -> Scene:
        return self.item("load", name=name, kind="body-force", body=of, body_force=force)

    def heat(self, name: str, of: str, temperature: Any) -> Scene:
        return self.item("load", name=name, kind="temperature", body=of, temperature=temperature)

    def pushed(self, name: str, obstacle: str, **keys: Any) -> Scene:
        """A load on the obstacle of a contact."""
        return self.item("load", name=name, kind="obstacle", obstacle=obstacle, **keys)

    def contact(self, name: str, slave: Any, master: Any = None, **keys: Any) -> Scene:
        keys = _with_shape("obstacle", keys)
        return self.item("contact", name=name, slave=slave, master=master, **keys)

    def probe(self, name: str, of: str, point: Sequence[Any]) -> Scene:
        return self.item("probe", name=name, body=of, point=point)

    def stages(self, *stages: str) -> Scene:
        """One stage for each text: ``press``, or ``press=0.5 shear`` for factors other than 1."""
        words = [[word.partition("=") for word in stage.split()] for stage in stages]
        items = ({load: float(to or 1.0) for load, _, to in one} for one in words)
        return self.add(*(Scene().item("stage", **one) for one in items))


_PART = Scene()
table, item, material, body = _PART.table, _PART.item, _PART.material, _PART.body
support, pin, load, body_force, heat = _PART.support, _PART.pin, _PART.load, _PART.body_force, _PART.heat
pushed, contact, probe, stages = _PART.pushed, _PART.contact, _PART.probe, _PART.stages


def head(plane: str, **model: Any) -> Scene:
    """How every case begins."""
    return Scene("format = 1\n").table("model", plane=plane, **model)


def scene(plane: str, name: str = "steel", /, E: Any = 210e3, nu: Any = 0.3, **more: Any) -> Scene:
    """How a case with one isotropic material begins."""
    return head(plane).material(name, E=E, nu=nu, **more)


def neo_hookean(name: str, modulus: float, poisson: float) -> Scene:
    return material(name, E=modulus, nu=poisson, law="neo-hookean")


def rubber(modulus: float, poisson: float) -> Scene:
    """How a case at finite strain begins."""
    return head("strain", strain="finite") + neo_hookean("rubber", modulus, poisson)


def box(x: Sequence[Any], y: Sequence[Any]) -> dict[str, Any]:
    """The shape of a rectangle."""
    return {"kind": "rectangle", "x": x, "y": y}


def disk(center: Sequence[Any], radius: Any) -> dict[str, Any]:
    return {"kind": "disk", "center": center, "radius": radius}


def annulus(center: Sequence[Any], radii: Sequence[Any]) -> dict[str, Any]:
    return {"kind": "annulus", "center": center, "radii": radii}


def half_disk(center: Sequence[Any], radius: Any, side: str = "lower") -> dict[str, Any]:
    return {"kind": "half-disk", "center": center, "radius": radius, "side": side}


def polygon(points: Sequence[Any], names: str, **more: Any) -> dict[str, Any]:
    """A polygon, its sides named by the words of ``names``."""
    return {"kind": "polygon", "points": points, "names": names.split(), **more}


def polyline(*points: Sequence[Any]) -> dict[str, Any]:
    return {"kind": "polyline", "points": points}


def plane(point: Sequence[Any], normal: Sequence[Any]) -> dict[str, Any]:
    """A flat obstacle."""
    return {"kind": "plane", "point": point, "normal": normal}


SHAPES: dict[str, Callable[..., dict[str, Any]]] = {
    make.__name__: make for make in (box, disk, annulus, half_disk, polygon, polyline, plane)
}
FLOOR = plane([0.0, 0.0], [0.0, 1.0])


def _with_shape(name: str, keys: dict[str, Any]) -> dict[str, Any]:
    """The keys with the shape that is given by its kind under this name."""
    return dict((name, SHAPES[key](*value)) if key in SHAPES else (key, value) for key, value in keys.items())


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
