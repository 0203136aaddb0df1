"""Expressions in x and y: what they mean, and what is refused."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.case.model.expressions import ExpressionError, compile_expression, value_at


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        ("-x + 2*y", -2.0 + 6.0),
        ("x**2 - y/x", 4.0 - 1.5),
        ("2**-x", 0.25),
        ("-x**2", -4.0),
        ("sin(pi*x) + cos(0)", math.sin(2.0 * math.pi) + 1.0),
        ("max(x, y, 1) - min(x, y)", 1.0),
        ("hypot(x, y)", math.hypot(2.0, 3.0)),
        ("atan2(y, x)", math.atan2(3.0, 2.0)),
        ("sqrt(abs(-x)) * exp(log(y))", math.sqrt(2.0) * 3.0),
        ("5 if x < y else 7", 5.0),
        ("5 if x > y or x >= 2.5 else 7", 7.0),
        ("(1 <= x < 3) * y", 3.0),
        ("1 if x > 1 and y > 1 else 0", 1.0),
        # Only the branch that is taken has to have a value.
        ("1 / (x - 2) if x > 2 else 0", 0.0),
    ],
)
def test_values(text: str, value: float) -> None:
    assert value_at(text, 2.0, 3.0) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("__import__('os').system('touch {}')", "cannot be called"),
        ("open('{}', 'w')", '"open" cannot be called'),
        ("x.__class__", "not allowed"),
        ("[x for x in (1,)][0]", "not allowed"),
        ("(lambda: x)()", "cannot be called"),
        ("f'{x}'", "not allowed"),
        ("'{}'", "not a number"),
        ("True", "not a number"),
        ("1j", "not a number"),
        ("z", '"z" is not defined'),
        ("sine(x)", 'did you mean "sin"'),
        ("sin", "is a function"),
        ("sin(x, y)", "takes 1 arguments, not 2"),
        ("max(x)", "takes 2 or more"),
        ("sin(x=1)", "takes 1 arguments"),
        ("max(*x, y)", "not allowed"),
        ("x^2", "x**2"),
        ("x // 2", "not allowed"),
        ("x == 1", "not allowed"),
        ("not x", "not allowed"),
        ("x := 1", "not an expression"),
        ("", "not an expression"),
        ("(" * 300 + "x" + ")" * 300, "characters"),
        ("(" * 210 + "x" + ")" * 210, "not an expression"),
        ("-" * 200 + "x", "nested"),
        ("x" + "+1" * 120, "nested"),
        ("9" * 400, "too large"),
    ],
)
def test_refusals(text: str, words: str, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    with pytest.raises(ExpressionError) as caught:
        compile_expression(text.replace("{}", str(victim)))
    assert words in str(caught.value)
    assert not victim.exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1/x", "divides by zero at (0, 1)"),
        ("sqrt(x - 1)", "has no value"),
        ("(x - 8)**(1/3)", "has no value"),
        ("9**9**9**9", "has no value"),
        ("1e308 * 10 * y", "not finite"),
        ("1e308*10 - 1e308*10", "not finite"),
    ],
)
def test_values_that_do_not_exist(text: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value_at(text, 0.0, 1.0)
    assert words in str(caught.value)


@given(st.text(alphabet="xy01.+-*/()<>,_ sincopelhabt\n'[]{}:=!&|~@;", max_size=60))
def test_any_text_is_a_value_or_an_error(text: str) -> None:
    with contextlib.suppress(ExpressionError):
        assert math.isfinite(value_at(text, 0.3, -0.7))
