"""Rows that arrive in any order give the same file."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uam_control.coordinates import coordinates
from uam_lab.experiments.faults.trial import ROWS, FaultResult
from uam_lab.experiments.trials.rows import RowTable, RowTableError
from uam_lab.experiments.trials.trial import TrialResult, result_rows

SCHEMA = pa.schema([("flight", pa.int64()), ("error", pa.float64()), ("why", pa.string())])


def row(number):
    return {
        "flight": number,
        "error": np.nan if number % 3 == 0 else number / 7,
        "why": "x" * number,
    }


def table(folder, of="x"):
    return RowTable(Path(folder) / "flights.parquet", SCHEMA, {"seed": of, "code": "c"})


@settings(max_examples=25, deadline=None)
@given(
    arrivals=st.lists(st.integers(0, 20), min_size=1),
    ends=st.sets(st.integers(0, 40)),
    compacted=st.booleans(),
)
def test_any_order_and_repetition_gives_the_same_bytes(arrivals, ends, compacted):
    """ends: arrivals after which the process ends and another one continues."""
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        with table(one) as plain:
            for number in sorted(set(arrivals)):
                plain.add(row(number))
        plain.compact()
        rows = table(other)
        for k, number in enumerate(arrivals):
            rows.add(row(number))
            if k in ends:
                rows.compact() if compacted else rows.flush()
                rows = table(other)
        assert rows.compact()["flight"].to_pylist() == sorted(set(arrivals))
        files = [Path(folder) / "flights.parquet" for folder in (one, other)]
        assert files[0].read_bytes() == files[1].read_bytes()
        assert list(Path(other).iterdir()) == [files[1]]  # no part is left


def test_rows_that_two_parts_have_are_merged(tmp_path):
    for _ in range(2):  # two commands on one folder
        rows = table(tmp_path)
        rows.keys.clear()
        rows.add(row(4))
        rows.flush()
    assert table(tmp_path).compact().num_rows == 1


def test_many_parts_are_merged_in_between(tmp_path, monkeypatch):
    monkeypatch.setattr("uam_lab.experiments.trials.rows.PARTS", 3)
    rows = table(tmp_path)
    for number in range(7):
        rows.add(row(number))
        rows.flush()
    assert len(list((tmp_path / "flights.parts").iterdir())) == 1
    assert pq.read_table(tmp_path / "flights.parquet").num_rows == 6
    assert table(tmp_path).keys == set(range(7))


def test_rows_of_other_inputs_are_refused(tmp_path):
    with table(tmp_path) as rows:
        rows.add(row(1))
    with pytest.raises(RowTableError, match="settings: seed was x, is y; undo the change"):
        table(tmp_path, "y")


def test_a_damaged_file_is_refused_in_one_line(tmp_path):
    (tmp_path / "flights.parquet").write_bytes(b"no parquet")
    with pytest.raises(RowTableError) as error:
        table(tmp_path)
    assert "cannot be read" in str(error.value) and "\n" not in str(error.value)


def test_a_killed_process_leaves_whole_parts(tmp_path):
    code = (
        "import os, signal, sys; sys.path[:0] = json.loads(sys.argv[1]);"
        "import test_row_table as t;"
        "rows = t.table(sys.argv[2]); rows.add(t.row(1)); rows.flush(); rows.add(t.row(2));"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    paths = json.dumps([str(Path(__file__).parent), *sys.path])
    subprocess.run([sys.executable, "-c", "import json;" + code, paths, str(tmp_path)])
    assert table(tmp_path).keys == {1}


def trial_result(seed):
    rms = np.linspace(0.1, np.pi, 8)
    rms[3] = np.nan
    figures = (0.5, True, "lost", "fell", None, (0.1, 0.2), {"K0": 1.0}, {"wind": 1.5})
    return TrialResult("random", 0.1, seed, rms, 2 * rms, *figures)


def test_a_trial_is_read_back_as_it_was(tmp_path):
    given = trial_result(3)
    file = tmp_path / "flights.parquet"
    rows = result_rows(2, ["wind"])
    with RowTable(file, rows.schema, {"seed": "x"}) as table:
        table.add(rows.to_row(7, given))
    (stored,) = table.compact().to_pylist()
    assert stored["flight"] == 7 and stored["drawn.wind"] == 1.5
    assert [n for n in stored if n.startswith("rms.")] == [f"rms.{n}" for n in coordinates(2)]
    read = rows.from_row(stored)
    for name, value in vars(given).items():
        np.testing.assert_array_equal(getattr(read, name), value, name)


def test_a_flight_of_a_fault_matrix_is_read_back_as_it_was(tmp_path):
    happened = ({"fault": "motor_loss", "begin_s": 3.5},)
    given = FaultResult("a", "b", "held", "", 4.5, {"arm_deg": [1.0, None]}, happened, None, True)
    with RowTable(tmp_path / "flights.parquet", ROWS.schema, {"seed": "x"}) as rows:
        rows.add(ROWS.to_row(0, given))
    (stored,) = rows.compact().to_pylist()
    assert ROWS.from_row(stored) == given
