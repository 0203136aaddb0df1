"""Arithmetic of power series of fields.

A :class:`Series` has coefficients (K + 1, j, n) of orders 0 to K in a path parameter at n points: j = 1 of
the value, j = 3 of the value and its derivatives by X and Y. Its operators record on a :class:`Tape` how
coefficient k of the result follows from coefficients 0 to k of the operands, and from those below k of the
result itself (Griewank and Walther 2008, Evaluating Derivatives, doi:10.1137/1.9780898717761, chapter 13).
:meth:`Tape.advance` then computes an order of all series, in the order in which they were made. An order may
be computed again with other values of the inputs.

With x' the derivative by the path parameter, recurrences follow from

    y = u / v      v y = u                 y = log x      x y' = x'
    y = exp x      y' = y x'               y = x^p        x y' = p x' y
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.roundoff import LAST_DIGITS

MAX_ITERATIONS = 60
"""Newton steps for the value of an implicit function."""


class Series:
    """A series with ``values`` (K + 1, j, n) on a ``tape``. Operands of its operators are series or numbers;
    zeros and ones leave no trace."""

    __slots__ = ("tape", "values")

    def __init__(self, tape: Tape, values: FloatArray) -> None:
        self.tape, self.values = tape, values

    def __add__(self, other: Term) -> Series:
        if isinstance(other, Series):
            return self.tape.record(lambda _, k: self.values[k] + other.values[k])
        x = self.values
        return self if other == 0.0 else self.tape.record(lambda _, k: x[k] if k else _shifted(x[0], other))

    def __sub__(self, other: Term) -> Series:
        if isinstance(other, Series):
            return self.tape.record(lambda _, k: self.values[k] - other.values[k])
        return self + -other

    def __mul__(self, other: Term) -> Term:
        if isinstance(other, Series):
            product = squared if other is self else convolved
            return self.tape.record(lambda _, k: product(self.values, other.values, k))
        if other in (0.0, 1.0):
            return self if other else 0.0
        return self.tape.record(lambda _, k: other * self.values[k])

    def __truediv__(self, other: Term) -> Term:
        if not isinstance(other, Series):
            return self * (1.0 / other)
        return self.tape.record(lambda out, k: _quotient(out, other.values, k, self.values[k]))

    def __rtruediv__(self, other: float) -> Term:
        if other == 0.0:
            return 0.0
        return self.tape.record(lambda out, k: _quotient(out, self.values, k, other))

    def __neg__(self) -> Term:
        return self * -1.0

    def __radd__(self, other: float) -> Series:
        return self + other

    def __rsub__(self, other: float) -> Term:
        return -self + other

    def __rmul__(self, other: float) -> Term:
        return self * other

    def __pow__(self, power: float) -> Term:
        """The ``power`` of a series with positive values; the square of any series."""
        if power == 2.0:
            return self * self
        if power in (0.0, 1.0):
            return self if power else 1.0

        def coefficient(out: FloatArray, k: int) -> FloatArray:
            x = self.values
            if not k:
                return composed(x[0], x[0, 0] ** power, power * x[0, 0] ** (power - 1.0))
            weights = ((power + 1.0) * np.arange(1, k + 1) - k) / k
            return times(inverse(x[0]), convolved(x, out, k, 1, weights=weights))

        return self.tape.record(coefficient)


Term = Series | float
"""A series, or a number that is constant in space and along the path."""


def linear(pairs: Iterable[tuple[Term, float]], constant: float = 0.0) -> Term:
    """A ``constant`` plus series times factors. Factors of zeros may be nan."""
    terms = [(term, factor) for term, factor in pairs if isinstance(term, Series) and factor != 0.0]
    if not terms:
        return constant

    def coefficient(_: FloatArray, k: int) -> FloatArray:
        total: FloatArray = terms[0][1] * terms[0][0].values[k]
        for term, factor in terms[1:]:
            total += factor * term.values[k]
        if constant and not k:
            total[0] += constant
        return total

    return terms[0][0].tape.record(coefficient)


def dot(*pairs: tuple[Term, Series]) -> Series:
    """Sum of the products of ``pairs`` of a series or number and a series."""

    def coefficient(_: FloatArray, k: int) -> FloatArray:
        total, *rest = (
            convolved(x.values, y.values, k) if isinstance(x, Series) else x * y.values[k] for x, y in pairs
        )
        for part in rest:
            total += part
        return total

    return pairs[0][1].tape.record(coefficient)


class Tape:
    """Series of ``orders`` at ``points`` (n) points, with ``jets`` of 1 or 3 numbers each."""

    def __init__(self, orders: int, jets: int, points: int) -> None:
        self._shape = (orders + 1, jets, points)
        self._steps: list[tuple[Callable[[int], None], Series]] = []

    def input(self) -> Series:
        """A series whose values are set by the caller, zero until then."""
        return Series(self, np.zeros(self._shape))

    def as_series(self, term: Term) -> Series:
        """A series, or the one of a constant."""
        if isinstance(term, Series):
            return term
        made = self.input()
        made.values[0, 0] = term
        return made

    def record(self, coefficient: Callable[[FloatArray, int], FloatArray]) -> Series:
        """The series whose coefficient k, (j, n), is ``coefficient`` of its own values and k."""
        made = self.input()

        def step(k: int) -> None:
            made.values[k] = coefficient(made.values, k)

        self._steps.append((step, made))
        return made

    def advance(self, order: int) -> None:
        """Compute the coefficients of ``order`` of all series but the inputs."""
        for step, _ in self._steps:
            step(order)

    def root(self, equation: Callable[[Series], Series]) -> Series:
        """The series x with ``equation(x)`` = 0, nearest to 0: its value by Newton's method with steps of at
        most 1, all else by the chain rule. Coefficient k > 0 of every series made by the equation is linear
        in that of x, with slopes that are its first order for x_1 = 1."""
        first, x = len(self._steps), self.input()
        residual = equation(x)
        inner, self._steps = self._steps[first:], self._steps[:first]
        slopes = [np.zeros(self._shape[1:]) for _ in inner]
        slope = slopes[[made is residual for _, made in inner].index(True)]

        def evaluate(order: int) -> FloatArray:
            for step, _ in inner:
                step(order)
            return np.asarray(residual.values[order])

        def derive() -> None:
            x.values[1, 0] = 1.0
            evaluate(1)
            x.values[1, 0] = 0.0
            for (_, made), known in zip(inner, slopes, strict=True):
                known[:] = made.values[1]

        def step(order: int) -> None:
            x.values[order] = 0.0
            if order:
                x.values[order] = -times(inverse(slope), evaluate(order))
                for (_, made), known in zip(inner, slopes, strict=True):
                    made.values[order] += times(known, x.values[order])
                return
            for _ in range(MAX_ITERATIONS):
                left = evaluate(0)[0].copy()
                derive()
                change = np.clip(-left / slope[0], -1.0, 1.0)
                x.values[0, 0] += change
                if not np.abs(change).max(initial=0.0) > LAST_DIGITS:
                    break
            x.values[0, 1:] = -evaluate(0)[1:] / slope[0]
            evaluate(0)
            derive()

        self._steps.append((step, x))
        return x


def log(x: Term) -> Term:
    """The logarithm of a series with positive values, or of a number."""
    if not isinstance(x, Series):
        return math.log(x)

    def coefficient(out: FloatArray, k: int) -> FloatArray:
        if not k:
            return composed(x.values[0], np.log(x.values[0, 0]), 1.0 / x.values[0, 0])
        rest = x.values[k]
        if k > 1:
            rest = rest - convolved(out, x.values, k, 1, k - 1, np.arange(1, k) / k)
        return times(inverse(x.values[0]), rest)

    return x.tape.record(coefficient)


def exp(x: Series) -> Series:
    """The exponential of a series."""

    def coefficient(out: FloatArray, k: int) -> FloatArray:
        if not k:
            value = np.exp(x.values[0, 0])
            return composed(x.values[0], value, value)
        return convolved(x.values, out, k, 1, weights=np.arange(1, k + 1) / k)

    return x.tape.record(coefficient)


def analytic(x: Series, *functions: Callable[[FloatArray, int], FloatArray]) -> list[Series]:
    """Functions of a series, each by its first m Taylor coefficients (m, n) about values (n,): sums of powers
    of the series less its value."""
    count, points = len(x.values) + 1, x.values.shape[2]

    def less_value(_: FloatArray, k: int) -> FloatArray:
        return x.values[k] if k else composed(x.values[0], np.zeros(points), np.ones(points))

    powers = [x.tape.record(less_value)]

    def next_power(power: int, last: Series, _: FloatArray, k: int) -> FloatArray:
        # Of order 0 only derivatives by X and Y are left.
        if k + 1 < power:
            return np.zeros(x.values.shape[1:])
        return convolved(last.values, powers[0].values, k)

    for power in range(2, count):
        powers.append(x.tape.record(partial(next_power, power, powers[-1])))

    def composition(
        function: Callable[[FloatArray, int], FloatArray], taylor: FloatArray, _: FloatArray, k: int
    ) -> FloatArray:
        if not k:
            taylor[:] = function(x.values[0, 0], len(taylor))
            return composed(x.values[0], taylor[0], taylor[1])
        used = powers[: k + 1]
        total: FloatArray = taylor[1] * used[0].values[k]
        for power, factor in zip(used[1:], taylor[2:], strict=False):
            total += factor * power.values[k]
        return total

    return [
        x.tape.record(partial(composition, function, np.zeros((count, points)))) for function in functions
    ]


def composed(x: FloatArray, value: FloatArray, slope: FloatArray) -> FloatArray:
    """The jet (j, n) of a function of the jet ``x`` (j, n), from its ``value`` (n,) and ``slope`` (n,)."""
    return np.concatenate([value[None], slope * x[1:]])


def convolved(
    one: FloatArray,
    other: FloatArray,
    order: int,
    first: int = 0,
    last: int | None = None,
    weights: FloatArray | None = None,
) -> FloatArray:
    """Contribution (j, n) of the orders ``first`` to ``last`` (default all) of ``one`` (K + 1, j, n), times
    ``weights`` if given, to the coefficient of ``order`` of its product with ``other`` (K + 1, j, n)."""
    end = order if last is None else last
    low = one[first : end + 1]
    if weights is not None:
        low = weights[:, None, None] * low
    return _summed(low, other[order - end : order - first + 1][::-1])


def squared(one: FloatArray, _: FloatArray, order: int) -> FloatArray:
    """Coefficient (j, n) of ``order`` of a square: products of two different orders occur twice."""
    half = (order + 1) // 2
    middle = 0.0 if order % 2 else times(one[half], one[half])
    if not half:
        return np.asarray(middle)
    return 2.0 * _summed(one[:half], one[order - half + 1 : order + 1][::-1]) + middle


def _summed(low: FloatArray, high: FloatArray) -> FloatArray:
    """Sum over the first axis of products of jets ``low`` and ``high`` (k, j, n): (j, n)."""
    result: FloatArray = np.einsum("kn,kjn->jn", low[:, 0], high)
    if low.shape[1] > 1:
        result[1:] += np.einsum("kjn,kn->jn", low[:, 1:], high[:, 0])
    return result


def times(one: FloatArray, other: FloatArray) -> FloatArray:
    """Product of two jets (j, n)."""
    return _summed(one[None], other[None])


def inverse(x: FloatArray) -> FloatArray:
    """Reciprocal of a jet (j, n)."""
    return composed(x, 1.0 / x[0], -1.0 / x[0] ** 2)


def _shifted(x: FloatArray, shift: float) -> FloatArray:
    moved = x.copy()
    moved[0] += shift
    return moved


def _quotient(out: FloatArray, divisor: FloatArray, order: int, dividend: FloatArray | float) -> FloatArray:
    """Coefficient (j, n) of ``order`` of a quotient with lower ones ``out`` (K + 1, j, n); the ``dividend``
    is its coefficient (j, n) of this order, or a constant."""
    rest = dividend
    if not isinstance(dividend, np.ndarray):
        rest = np.zeros(out.shape[1:])
        rest[0] = 0.0 if order else dividend
    if order:
        rest = rest - convolved(divisor, out, order, 1)
    return times(inverse(divisor[0]), np.asarray(rest))
