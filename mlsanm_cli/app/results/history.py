"""Pressures of contacts at any position of a stored path, and their forces along it."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.app.results.interpolation import checked_error
from mlsanm_cli.app.results.path_lookup import SERIES, level_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import RunData


def pressures_at(run: RunData, position: float) -> dict[str, FloatArray]:
    """Pressure (m,) of every contact at a path position.

    Raises RunError where the path does not reach the position, or where too little is stored about it.
    """
    level = level_at(run, position)
    for contact in run.contacts.values():
        checked_error(run, level, "pressures", contact.pressure)
    if level.how != SERIES:
        return {name: level.between(contact.pressure) for name, contact in run.contacts.items()}
    ends = np.cumsum([len(run.contacts[name].arc_length) for name in run.unilateral_contacts])
    found = dict(zip(run.unilateral_contacts, np.split(level.pressure, ends[:-1]), strict=True))
    for name, rows in run.maps["bonds"].items():
        found[name] = np.split(rows @ level.unknowns, 2)[0]
    return {name: found[name] for name in run.contacts}


def pressing_force(run: RunData, name: str) -> FloatArray:
    """The force (S+1, 2) of a contact's pressures on its slave; at finite strain of its tractions too."""
    contact = run.contacts[name]
    if run.is_finite:
        # Normals turn and lengths change: the forces are stored as such.
        return np.asarray(run.path.resultants[f"contact {name}"])
    return np.asarray(contact.pressure @ (contact.weight[:, None] * contact.normal))


def tangential_force(run: RunData, name: str) -> FloatArray:
    """The force (S+1,) of a contact on its master along the mean tangent."""
    contact = run.contacts[name]
    if run.is_finite:
        n_x, n_y = mean_normal(run, name)
        return np.asarray(-pressing_force(run, name) @ np.array([n_y, -n_x]))
    return np.asarray(-(contact.traction @ contact.weight))


def mean_normal(run: RunData, name: str) -> FloatArray:
    """The mean (2,) of a contact's normals before loading, where it is pressed at some time, as a unit
    vector."""
    contact = run.contacts[name]
    weight = np.where((contact.pressure > 0.0).any(axis=0), contact.weight, 0.0)
    mean = (weight if weight.any() else contact.weight) @ contact.normal
    return np.asarray(mean / np.hypot(*mean))
