"""``--set KEY=VALUE``."""

from __future__ import annotations

import pytest

from mlsanm_cli.case.reading.overrides import flat, parse_vary, points
from mlsanm_cli.errors import RunError
from tests.case.scenes import HERTZ, only, parse, problems


def test_items_by_name_and_index_in_order_with_texts_without_quotes_and_wildcards() -> None:
    case = parse(
        HERTZ,
        [
            "body.*.spacing=2.5",
            "body.1.spacing=3",
            "body.*.refine=[]",
            "body.cylinder.refine=[{at=[0, 0], spacing=0.02, radius=1}]",
            "body.cylinder.refine.0.spacing=0.01",
            "load.press.force=[0,-1]",
            "load.press.force.0=0.25",
            "contact.interface.regularization.eta=1e-3",
            "contact.*.regularization.law=hyperbolic",
            "solver.order=12",
            "solver.order=13",
            "solver.linear=superlu",
            "stage=[{press=0.5},{press=1.0}]",
            'material."steel".nu=0.25',
            ' model.plane = "stress" ',
            "title=A pressed block",
            'body.block.name="base"',
            'support.0.boundary="base.bottom"',
            'contact.interface.master="base.top"',
            "body.base.seed=3",
        ],
    ).case
    assert [(body.name, body.spacing, body.seed) for body in case.body] == [
        ("cylinder", 2.5, 0),
        ("base", 3.0, 3),
    ]
    assert ([one.spacing for one in case.body[0].refine], case.body[1].refine) == ([0.01], ())
    assert case.load[0].model_dump()["force"] == (0.25, -1.0)
    assert (case.contact[0].regularization.eta, case.contact[0].regularization.law) == (1e-3, "hyperbolic")
    assert (case.solver.order, case.solver.linear, case.title) == (13, "superlu", "A pressed block")
    assert case.stage == ({"press": 0.5}, {"press": 1.0})
    assert (case.material["steel"].nu, case.model.plane) == (0.25, "stress")


@pytest.mark.parametrize(
    ("setting", "key", "words"),
    [
        ("body.cylindr.spacing=1", "body.cylindr.spacing", 'did you mean "cylinder"'),
        ("body.7.spacing=1", "body.7.spacing", "2 items"),
        ("support.bottom.ux=0", "support.bottom.ux", "1 item,"),
        ("stage.0.press=1", "stage.0.press", "no items"),
        ("solver.ordre=12", "solver.ordre", 'did you mean "order"'),
        ("slover.order=12", "slover", 'did you mean "solver"'),
        ("solver.order.x=12", "solver.order", "whole number"),
        ("title.x=12", "title.x", "single value"),
        ("solver.method=anmm", "solver.method", 'did you mean "anm"'),
        ("solver.method=[anm", "solver.method", "not TOML"),
        ("probe.*.point=[0,0]", "probe.*.point", "matches nothing"),
        ("contact.*=1", "contact.*", "matches nothing"),
        ("solver.order=", "solver.order", "(empty)"),
        ("solver.order", "solver.order", "KEY=VALUE"),
        ("solver.order=1\nevil=2", "solver.order", "not TOML"),
        ("=1", "=1", "not a dotted key"),
        ("solver.=1", "solver.", "not a dotted key"),
    ],
)
def test_wrong_settings(setting: str, key: str, words: str) -> None:
    problem = only(HERTZ, [setting])
    assert (problem.source, problem.line, problem.key) == ("--set", 0, key)
    assert words in str(problem)
    assert str(problem).startswith("--set: ")


def test_a_fault_of_the_file_keeps_its_line_beside_a_setting() -> None:
    found = problems(HERTZ.replace("radius = 50.0", "radius = -1"), ["body.cylinder.spacing=-1"])
    assert [(p.source, p.line) for p in found] == [("case.toml", 18), ("--set", 0)]


def test_a_setting_repairs_the_file() -> None:
    broken = HERTZ.replace("radius = 50.0", "radius = -1")
    assert parse(broken, ["body.cylinder.shape.radius=50.0"]).case == parse(HERTZ).case


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0.1", ("0.1",)),
        ("a.b = 1, 2.5 ,3e-4", ("1", "2.5", "0.0003")),
        ('a="anm","newton"', ('"anm"', '"newton"')),
        ("a=anm, newton", ('"anm"', '"newton"')),
        ("a=true,false", ("true", "false")),
        ("a=[1.0, 2.0],[3.0, 4.0]", ("[1.0, 2.0]", "[3.0, 4.0]")),
        ('a={kind = "disk", radius = 1.0}', ('{ kind = "disk", radius = 1.0 }',)),
        ("a=0.0:0.5:3", ("0.0", "0.25", "0.5")),
        ("a=0:1:3", ("0.0", "0.5", "1.0")),
        ("a=10:20:3", ("10", "15", "20")),
        ("a=20:10:3", ("20", "15", "10")),
        ("a=0.3:0.7:1", ("0.3",)),
        ("a=0.1:0.7:4", ("0.1", "0.3", "0.5", "0.7")),
    ],
)
def test_values(text: str, values: tuple[str, ...]) -> None:
    assert parse_vary(text).values == values


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a", "expected KEY=VALUES"),
        ("a=", "expected KEY=VALUES"),
        ("a=[anm", "not TOML"),
        ("a=1\nb=2", "not TOML"),
        ("a=1,1.0,1", "twice"),
        ("a=0:1:0", "number of values"),
        ("a=0:1:10000000", "number of values"),
        ("a=0:x:3", "not TOML"),
        ("a=0:true:3", "not a number"),
    ],
)
def test_what_cannot_be_read_is_told(text: str, told: str) -> None:
    with pytest.raises(RunError, match=told):
        parse_vary(text)


def test_every_combination_is_a_point() -> None:
    found = points([parse_vary("a=1,2"), parse_vary("b=3:5:3")])
    assert len(found) == len(set(found)) == 6
    assert found[:2] == [("a=1", "b=3"), ("a=1", "b=4")]


def test_absurd_sweeps_are_refused() -> None:
    with pytest.raises(RunError, match="varied twice"):
        points([parse_vary("a=1"), parse_vary("a=2")])
    with pytest.raises(RunError, match="1000000 points"):
        points([parse_vary(f"{name}=1:1000:1000") for name in "ab"])


def test_flat_keys_are_those_of_set() -> None:
    content = {"contact": [{"name": "c", "law": {"eta": 1.0}}], "stage": [{"p": 1.0}], "at": [1.0, 2.0]}
    values = {"contact.c.name": "c", "contact.c.law.eta": 1.0, "stage.0.p": 1.0, "at": [1.0, 2.0]}
    assert flat(content) == values
