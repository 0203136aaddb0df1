"""JSON, JSON lines, CSV and TOML: what is written reads back, and never half of it."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.errors import RunError
from mlsanm_cli.io.files import EventLog, cannot_write, read_summary, replacing, write_csv, write_json_atomic
from mlsanm_cli.io.schema import INTERFACE_COLUMNS
from mlsanm_cli.toml import plain


@pytest.mark.parametrize(
    "content",
    ["[]", '{"contacts": {"a": [1]}}', '{"forces": [1]}', '{"seconds": "none"}', '{"checks": {"a": 1}}'],
)
def test_what_is_no_summary_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text(content)
    with pytest.raises(RunError, match="not the summary of a run"):
        read_summary(tmp_path / "summary.json")


def test_json_converts_numpy_and_turns_nan_and_inf_into_null(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    given = {"int": np.int64(3), "float": np.float32(0.5), "flag": np.bool_(True), "nan": float("nan")}
    given |= {"inf": np.float64(-np.inf), "array": np.array([[1.0, np.nan], [2.0, 3.0]]), "set": {2, 1}}
    write_json_atomic(path, {**given, "nested": {"tuple": (1, None), "path": Path("a/b"), 5: "ü"}})
    plain_values = {"int": 3, "float": 0.5, "flag": True, "nan": None, "inf": None, "set": [1, 2]}
    nested = {"tuple": [1, None], "path": "a/b", "5": "ü"}
    expected = {**plain_values, "array": [[1.0, None], [2.0, 3.0]], "nested": nested}
    assert json.loads(path.read_text(encoding="utf-8")) == expected
    assert "ü" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("value", [b"x", object(), 1j, np.array([1j]), lambda: 0])
def test_values_without_a_plain_form_are_refused(value: Any) -> None:
    with pytest.raises(TypeError, match="no JSON form"):
        plain({"a": [value]})


def test_a_failed_write_leaves_the_old_file_and_no_temporary(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    write_json_atomic(path, {"a": 1})
    with pytest.raises(TypeError):
        write_json_atomic(path, {"a": object()})

    def die() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        die()
    assert [entry.name for entry in tmp_path.iterdir()] == ["summary.json"]
    assert json.loads(path.read_text()) == {"a": 1}


def test_a_file_that_cannot_be_written_is_a_run_error_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="No such file or directory") as caught:
        write_json_atomic(tmp_path / "none" / "file", {})
    assert caught.value.exit_code == 2
    with pytest.raises(RunError, match="No such file"):
        EventLog(tmp_path / "none" / "events.jsonl")
    full = RuntimeError("a\n(errno = 28, error message = 'disk full')")
    assert cannot_write(Path("a"), full).message == "cannot write a: disk full"
    assert cannot_write(Path("a"), RuntimeError()).message == "cannot write a: RuntimeError"


def test_events_are_on_disk_line_by_line_and_a_second_opening_appends(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    with EventLog(path) as log:
        log.write("step", index=np.int64(1), residual=float("nan"))
        assert path.read_text() == '{"event": "step", "index": 1, "residual": null}\n'
        log.write("warning", text="two\nlines")
    with EventLog(path) as log:
        log.write("stop", reason="done")
    events = [json.loads(line) for line in path.read_text().splitlines()]
    assert [event["event"] for event in events] == ["step", "warning", "stop"]
    assert events[1]["text"] == "two\nlines"


def test_interface_csv_has_the_columns_in_order_and_every_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    columns: dict[str, Any] = {name: rng.standard_normal(9) * 1e-7 for name in INTERFACE_COLUMNS}
    columns["status"] = np.arange(9, dtype=np.int8) % 3
    path = tmp_path / "interface.csv"
    write_csv(path, columns)
    with path.open(newline="") as stream:
        header, *rows = csv.reader(stream)
    assert header == ["x", "y", "arc_length", "gap", "pressure", "traction", "slip", "status"]
    for index, name in enumerate(header[:-1]):
        assert [float(row[index]) for row in rows] == columns[name].tolist()
    assert [row[-1] for row in rows] == ["0", "1", "2"] * 3
    assert b"\r" not in path.read_bytes()
