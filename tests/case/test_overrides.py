"""``--set KEY=VALUE``."""

from __future__ import annotations

import pytest

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
