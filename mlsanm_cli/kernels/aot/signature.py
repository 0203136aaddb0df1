"""Argument and result types of a kernel, read from its annotations.

``Float1``, ``Int2``, ``Index1`` (32 bits), ``Bool2`` and so on are C-contiguous arrays of that many
dimensions which the kernel only reads; ``FloatOut1`` and so on are written to. Scalars are ``float`` and
``int``; a result is None, one of these or a tuple of them. mypy sees plain arrays: the dimensions serve the
compiler and the check of every argument before a call.
"""

from __future__ import annotations

import functools
import numbers
import operator
import re
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IndexArray, IntArray
from mlsanm_cli.records import dataclass

Float1: TypeAlias = FloatArray
Float2: TypeAlias = FloatArray
Float3: TypeAlias = FloatArray
FloatOut1: TypeAlias = FloatArray
FloatOut2: TypeAlias = FloatArray
FloatOut3: TypeAlias = FloatArray
Int1: TypeAlias = IntArray
Int2: TypeAlias = IntArray
IntOut1: TypeAlias = IntArray
Index1: TypeAlias = IndexArray
IndexOut1: TypeAlias = IndexArray
IndexOut2: TypeAlias = IndexArray
Bool2: TypeAlias = BoolArray

ARRAY = re.compile(r"(Float|Index|Int|Bool)(Out)?([1-3])")
DTYPES: dict[str, np.dtype[Any]] = {
    "Float": np.dtype(np.float64),
    "Index": np.dtype(np.int32),
    "Int": np.dtype(np.int64),
    "Bool": np.dtype(np.bool_),
}


@dataclass(frozen=True)
class Value:
    """An argument or part of a result; a scalar if ``ndim`` is 0."""

    name: str
    dtype: np.dtype[Any]
    ndim: int = 0
    written: bool = False

    @classmethod
    def of(cls, name: str, annotation: str) -> Value:
        """Parse an ``annotation``. Raises TypeError for unsupported types."""
        if annotation in ("float", "int"):
            return cls(name, DTYPES[annotation.capitalize()])
        parts = ARRAY.fullmatch(annotation)
        if parts is None:
            raise TypeError(f"{name}: {annotation!r} is not a type that a kernel can take or return")
        return cls(name, DTYPES[parts[1]], int(parts[3]), parts[2] is not None)

    @property
    def kinds(self) -> str:
        """Kinds of the words passed to machine code: p for pointers, i for integers, d for doubles."""
        if self.ndim == 0:
            return "d" if self.dtype.kind == "f" else "i"
        return "ppiip" + 2 * self.ndim * "i"

    def words(self, value: Any) -> tuple[Any, ...]:
        """The words of a number or an array. Raises TypeError for a value of another type."""
        if self.kinds == "d":
            if not isinstance(value, numbers.Real):
                raise TypeError(f"{self.name} must be a number, not {type(value).__name__}")
            return (float(value),)
        if self.kinds == "i":
            return (int(np.int64(operator.index(value))),)
        if (
            not isinstance(value, np.ndarray)
            or value.dtype != self.dtype
            or value.ndim != self.ndim
            or not value.flags.c_contiguous
            or not (value.flags.carray if self.written else value.flags.aligned)
        ):
            given = type(value).__name__
            if isinstance(value, np.ndarray):
                order = "C-contiguous" if value.flags.c_contiguous else "not C-contiguous"
                writable = "" if value.flags.writeable else ", read-only"
                given = f"{value.dtype} of {value.ndim} dimensions, {order}{writable}"
            required = f"a C-contiguous{', writable' if self.written else ''} {self.dtype} array"
            raise TypeError(f"{self.name} must be {required} of {self.ndim} dimensions, not {given}")
        address = value.__array_interface__["data"][0]
        # No owner: arguments are Python objects that outlive the call.
        return (None, None, value.size, value.itemsize, address, *value.shape, *value.strides)


class Inner:
    """A function that kernels may call."""

    __wrapped__: Callable[..., Any]

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        return self.__wrapped__(*arguments)


class Kernel(Inner):
    """A function that is called as machine code, which ``loaded`` gives at the first call. Its ``arguments``
    and ``results`` are read from its annotations; ``single`` unless the result is a tuple. Raises TypeError
    for unsupported types."""

    def __init__(self, function: Callable[..., Any], loaded: Callable[[Kernel], Callable[..., Any]]) -> None:
        super().__init__(function)
        self.name = f"{function.__module__}.{function.__name__}"
        annotations = dict(function.__annotations__)
        result = annotations.pop("return")
        self.single = not result.startswith("tuple[")
        parts = [] if result == "None" else [result] if self.single else result[6:-1].split(", ")
        self.arguments = [Value.of(f"{self.name}: {name}", kind) for name, kind in annotations.items()]
        self.results = [Value.of(f"{self.name}: its result", kind) for kind in parts]
        self._loaded = loaded

    def words(self, values: tuple[Any, ...]) -> Iterator[Any]:
        """All arguments as words for machine code."""
        if len(values) != len(self.arguments):
            raise TypeError(f"{self.name} takes {len(self.arguments)} arguments, not {len(values)}")
        for argument, value in zip(self.arguments, values, strict=True):
            yield from argument.words(value)

    @functools.cached_property
    def _call(self) -> Callable[..., Any]:
        return self._loaded(self)

    def __call__(self, *arguments: Any) -> Any:
        return self._call(*arguments)
