"""Defaults that depend on other tables: the stages, the law of the contacts, the common keys of one plate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

REGULARIZED = "hyperbolic"
"""The law of contacts with parameters or methods that the exact law does not have."""


def with_defaults(data: Any) -> Any:
    """The raw content of a case with all of these defaults."""
    if not isinstance(data, dict):
        return data
    data = _with_items(_with_law(data), "load", lambda row: _with_common_keys(row, data["load"]))
    return {**data, "stage": _stages(data)}


def _with_items(data: dict[str, Any], section: str, change: Callable[[Any], Any]) -> dict[str, Any]:
    """The content with every item of a list, if there is one, replaced by ``change`` of it."""
    items = data.get(section)
    return {**data, section: tuple(map(change, items))} if isinstance(items, tuple) else data


def _stages(data: dict[str, Any]) -> Any:
    """One stage up to load factor 1; an interference that no stage names is applied in the first one."""
    given = data.get("stage")
    fits = _names(data.get("contact"), with_key="interference")
    if given is None:
        return (dict.fromkeys([*_names(data.get("load")), *fits], 1.0),)
    if not isinstance(given, tuple) or not all(isinstance(stage, dict) for stage in given) or not given:
        return given
    growing = {name: 1.0 for name in fits if not any(name in stage for stage in given)}
    return ({**growing, **given[0]}, *given[1:])


def _names(items: Any, with_key: str = "name") -> list[str]:
    """Names of the items of a raw list that have a key."""
    rows = [item for item in items if isinstance(item, dict)] if isinstance(items, tuple) else []
    return [row["name"] for row in rows if isinstance(row.get("name"), str) and with_key in row]


def _with_common_keys(row: Any, rows: tuple[Any, ...]) -> Any:
    """A raw load on a plate, with the hinge of the other loads on it and, unless it sets its own, their kind
    of rotation."""
    if not isinstance(row, dict) or row.get("kind") != "platen":
        return row
    keys = ("kind", "boundary", "from", "to")
    others = [one for one in rows if isinstance(one, dict) and all(one.get(k) == row.get(k) for k in keys)]
    hinges = [one["hinge"] for one in others if "hinge" in one]
    common: dict[str, Any] = {"hinge": hinges[0]} if hinges else {}
    turning = [one.get("rotation", "free") for one in others if one.keys() & {"rotation", "hinge", "moment"}]
    if turning and not row.keys() & {"rotation", "hinge", "moment"}:
        common["rotation"] = 0.0 if isinstance(turning[0], float) else turning[0]
    return common | row


def _with_law(data: dict[str, Any]) -> dict[str, Any]:
    """The content with the regularised law in contacts that name no law, if another contact, a parameter of
    that law, the method or the formulation requires it; never at finite strain."""
    match data:
        case {"model": {"strain": "finite"}}:
            return data
        case {"solver": {"method": "anm" | "newton"}} | {"solver": {"formulation": "monolithic"}}:
            return _with_items(data, "contact", _regularized)
        case {"contact": tuple(contacts)} if any(map(_is_regularized, contacts)):
            return _with_items(data, "contact", _regularized)
    return data


def _is_regularized(contact: Any) -> bool:
    """Whether a contact names the regularised law, or only parameters of it."""
    match contact:
        case {"regularization": {**given}}:
            return bool(given) and given.get("law", REGULARIZED) == REGULARIZED
    return False


def _regularized(contact: Any) -> Any:
    match contact:
        case {"friction": "bonded"}:
            return contact
        case {"regularization": {**given}}:
            return {**contact, "regularization": {"law": REGULARIZED, **given}}
        case {**keys} if "regularization" not in keys:
            return {**contact, "regularization": {"law": REGULARIZED}}
    return contact
