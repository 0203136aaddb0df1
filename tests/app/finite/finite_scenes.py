"""Scenes at finite strain."""

from __future__ import annotations

from tests.case_text import Scene, head, material


def rubber(modulus: float, poisson: float) -> Scene:
    """Head of a case in plane strain, with one material."""
    return head("strain", strain="finite") + neo_hookean("rubber", modulus, poisson)


def neo_hookean(name: str, modulus: float, poisson: float) -> Scene:
    return material(name, E=modulus, nu=poisson, law="neo-hookean")
