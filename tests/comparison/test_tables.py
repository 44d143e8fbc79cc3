"""Tables that do not fit what `params.yaml` asks for: each fault is told, or changes nothing.

A number that is as good as another cannot be told from it by reading (DVC's digests can): such a
fault may change results, but no more than that.
"""

import contextlib
import random

import numpy as np
import pytest
from small_project import COMPARE, make_params, read_csv, write_csv, write_project

from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import claims, comparison, timing
from jumping_ant.comparison.results import load
from jumping_ant.evaluation import episodes
from jumping_ant.params.claims import of_project
from jumping_ant.training import curves

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1]
PARAMS = make_params(AGENTS, SEEDS)
FEW = make_params({"random": "random", "pgpe": "pgpe"}, SEEDS)
ASKED = of_project(PROJECT_ROOT, PARAMS)
LEARNED = 500.0
TABLES = {
    "results/agents/pgpe/episodes.csv": "evaluate@pgpe",
    "results/agents/pgpe/variants.csv": "evaluate@pgpe",
    "results/timing/pgpe/timing.csv": "train@pgpe",
    "models/pgpe/seed-3/curve.csv": "train@pgpe",
}
NOT_NUMBERS = ("x", "0x10", "1,5", "1;5", "1_000", "\u0663")
NUMBERS = ("+1", ".5", "1.", "01", "nan", "inf", "-inf", "1e999",  # as no stage writes them
           "", "0", "-1", "0.5", "1e-30", "1e+12", "-1e+12", "1e+30", "-1e+30",
           "1e+308")  # fmt: skip


@pytest.fixture
def project(tmp_path):
    write_project(tmp_path, AGENTS, SEEDS)
    return tmp_path


def compared(root, params=PARAMS):
    """All numbers and verdicts, those on seconds as well."""
    agents = load(root, params, curves.read_timed)
    judged = claims.judge(ASKED, agents, COMPARE, LEARNED)
    summary = comparison.summarize(agents, COMPARE)
    timed = timing.summarize(params, ASKED, agents, summary, [])
    return summary, judged, timed


def faults_of_structure(header, rows, generator):
    """Yield names of faults that must be noticed, and tables that have them at random places."""
    row, column = generator.randrange(len(rows)), generator.randrange(len(header))
    other = (column + generator.randrange(1, len(header))) % len(header)
    whole = [header, *rows]
    yield "no rows", [header]
    yield "one row", whole[:2]
    yield "a row less", [header, *rows[:row], *rows[row + 1 :]]
    yield "a row twice", [header, *rows[: row + 1], *rows[row:]]
    yield "all rows twice", [*whole, *rows]
    yield "rows in another order", [header, *generator.sample(rows, len(rows))]
    yield "a column less", [cells[:column] + cells[column + 1 :] for cells in whole]
    yield "a column twice", [[*cells, cells[column]] for cells in whole]
    yield "a second return", [[*header, "return"], *([*cells, "1"] for cells in rows)]
    yield "a name changed", [[*header[:column], "other", *header[column + 1 :]], *rows]
    swapped = list(header)
    swapped[column], swapped[other] = header[other], header[column]
    yield "two names swapped", [swapped, *rows]
    yield "no header", rows
    yield "another agent's", [header, *(["other", *cells[1:]] for cells in rows)]
    yield "another seed's", [header, *([cells[0], "9", *cells[2:]] for cells in rows)]
    for cell in NOT_NUMBERS:
        yield f"a cell {cell!r}", with_cell(header, rows, cell, generator)
    yield "nothing", []


def with_cell(header, rows, cell, generator):
    """Return the table with another cell at a random place that is not empty."""
    places = [(i, k) for i, cells in enumerate(rows) for k, old in enumerate(cells) if old]
    row, column = generator.choice(places)
    changed = [list(cells) for cells in rows]
    changed[row][column] = cell
    return [header, *changed]


@pytest.mark.parametrize("table", TABLES)
def test_a_fault_is_told_or_changes_nothing_but_by_numbers(project, table):
    """Numbers that a table may hold change results, however large; nothing is a traceback."""
    path, generator = project / table, random.Random(0)
    expected, lines = compared(project, FEW), path.read_text(encoding="utf-8").splitlines()
    header, *rows = (line.split(",") for line in lines)
    faults = {
        name: "".join(",".join(cells) + "\n" for cells in changed)
        for name, changed in faults_of_structure(header, rows, generator)
    }
    faults["its last line cut"] = "\n".join(lines)[: -generator.randrange(len(lines[-1]))]
    refused = 0
    for name, content in faults.items():
        path.write_text(content, encoding="utf-8")
        try:
            assert compared(project, FEW) == expected, name
        except InputError as error:
            refused += 1
            assert str(path) in str(error) and "\n" not in str(error)
            assert f"; run `dvc repro --force {TABLES[table]}`" in str(error)
    assert refused > 15
    for cell in NUMBERS:
        changed = with_cell(header, rows, cell, generator)
        path.write_text("".join(",".join(cells) + "\n" for cells in changed), encoding="utf-8")
        with contextlib.suppress(InputError):
            compared(project, FEW)


def test_rows_are_those_asked_for(project):
    later = PARAMS.evaluate.model_copy(update={"seed": 5})  # and 3 x 3 on
    with pytest.raises(InputError, match=r"given 0 rows of seed 3, episode 0, episode_seed 14,"):
        episodes.read(project, PARAMS.model_copy(update={"evaluate": later}), "sac")


def test_the_order_of_rows_changes_no_bit(project):
    expected = compared(project)
    for path in (Paths(project).agent("sac").episodes, Paths(project).agent("sac").variants):
        write_csv(path, read_csv(path)[::-1])
    assert compared(project) == expected


@pytest.mark.parametrize(
    ("table", "column", "cell", "fault"),
    [
        ("agents/sac/episodes", "length", "1001", "1001', allowed: a whole number from 1 to 1000"),
        ("agents/sac/episodes", "length", "9.5", "9.5', allowed: a whole number from 1 to 1000"),
        ("agents/sac/episodes", "flight", "1.5", "1.5', allowed: a number from 0 to 1"),
        ("agents/sac/episodes", "torque_change", "", "nan', allowed: a number from 0 to 4"),
        ("agents/sac/episodes", "fluidity", "-inf", "-inf', allowed: a number from -1e+30 to 0, "),
        ("agents/sac/episodes", "return", "1_000", "1_000', allowed: a number from -1e+30 to 1e"),
        ("agents/sac/variants", "variant", "best", "best', allowed: final"),
        ("timing/sac/timing", "seconds", "-1", "-1.0', allowed: a number from 0 to 1e+09"),
    ],
)
def test_a_cell_out_of_its_range_is_named(project, table, column, cell, fault):
    path = project / "results" / f"{table}.csv"
    rows = read_csv(path)
    rows[1][column] = cell
    write_csv(path, rows)
    with pytest.raises(InputError) as caught:
        compared(project)
    assert str(caught.value).startswith(f"{path}: row 2, column {column}: given '{fault}")


def test_numbers_are_read_to_the_last_bit(tmp_path):
    numbers = [0.1 + 0.2, 1 / 3, 5e-324, 1e23, 2.0**53, 123456.78901234567, -0.0]
    path = tmp_path / "a.csv"
    write_csv(path, [{"agent": "a", "x": number, "y": 7} for number in numbers])
    table = tables.read(path, "train", {"agent": "a"}, {"x": tables.ANY, "y": tables.SEED})
    assert table["x"].tobytes() == np.array(numbers).tobytes()
    assert table["y"].dtype == float


def test_seconds_of_a_learner_grow_from_its_first_row(project):
    path = Paths(project).agent("sac").timing
    rows = read_csv(path)
    for cell in ("0", "99"):
        write_csv(path, [rows[0] | {"seconds": cell}, *rows[1:]])
        with pytest.raises(InputError, match="given seconds that are 0 or shrink"):
            compared(project)
    write_csv(path, [rows[0] | {"seconds": "0.001"}, *rows[1:]])
    compared(project)
