"""What is stored once: a run that is resumed comes by again and must bring the same."""

from __future__ import annotations

import re
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mlsanm_cli.errors import RunError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


def keep(group: Any, name: str, value: NDArray[Any] | str) -> None:
    """Store an array or a text as ``name``; where it is stored already, RunError unless it is the same."""
    if name not in group:
        if isinstance(value, str):
            group.create_dataset(checked_name(name), data=value)
        else:
            store_array(group.id, name, value)
        return
    stored = group[name].asstr()[()] if isinstance(value, str) else group[name][...]
    place = f"{group.name}/{name}"
    if isinstance(value, str):
        if stored != value:
            raise differs(place)
        return
    same = stored.shape == value.shape and stored.dtype == value.dtype
    if not same or stored.tobytes() != np.ascontiguousarray(value).tobytes():
        raise differs(place)


def store_array(group: Any, name: str, array: NDArray[Any]) -> None:
    """Store an array, in C order, as ``name`` in the low-level ``group``.

    By the low-level calls, as every step of a path stores some: ``create_dataset`` takes four times as long.
    """
    kind, space = _kind(array.dtype), h5py.h5s.create_simple(array.shape)
    dataset = h5py.h5d.create(group, checked_name(name).encode(), kind, space, dcpl=_untimed())
    if array.size:
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, array, kind)


def store_number(group: Any, name: str, value: float) -> None:
    """Store a number as the attribute ``name``, which is not there yet, of the low-level ``group``."""
    number = np.asarray(value)
    kind = _kind(number.dtype)
    h5py.h5a.create(group, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR)).write(number, kind)


@lru_cache(maxsize=16)
def _kind(dtype: np.dtype[Any]) -> Any:
    """HDF5's name of a type of numbers."""
    return h5py.h5t.py_create(dtype, logical=True)


@cache
def _untimed() -> Any:
    """Properties of datasets that do not tell when they were made."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    return properties


def keep_names(group: Any, name: str, names: Sequence[str]) -> None:
    """The same for a list of names."""
    if name not in group:
        array = np.array(list(names), dtype=object)
        group.create_dataset(name, data=array, dtype=h5py.string_dtype())
    elif group[name].asstr()[...].tolist() != list(names):
        raise differs(f"{group.name}/{name}")


def checked_name(name: str) -> str:
    """``name`` if HDF5 can hold it as one path component; RunError otherwise."""
    if not name or name in {".", ".."} or re.search(r"[/\0]", name):
        raise RunError(f"the name {name!r} cannot be stored", hint='names must not be empty or hold "/"')
    return name


def ordered(parent: Any, name: str) -> Any:
    """A group whose members stay in the order of their making."""
    return parent[name] if name in parent else parent.create_group(name, track_order=True)


def floats(array: ArrayLike) -> NDArray[np.float64]:
    """Doubles in C order."""
    return np.ascontiguousarray(array, dtype=np.float64)


def check_shape(what: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    """ValueError if an array has another shape."""
    if array.shape != shape:
        raise ValueError(f"{what}: shape {array.shape}, expected {shape}")


def check_keys(what: str, given: Mapping[str, Any], expected: Sequence[str]) -> None:
    """ValueError if a step brings other names than the file was started with."""
    if given.keys() != set(expected):
        raise ValueError(f"{what} of the step are {sorted(given)}, expected {sorted(expected)}")


def differs(place: str) -> RunError:
    """The RunError for what a resumed run has other than it was."""
    return RunError(
        f"the run cannot be resumed: what is stored in {place} does not come out again",
        "another version, machine or library rounds differently; run the case again with --force",
    )
