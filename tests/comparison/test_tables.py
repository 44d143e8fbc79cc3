"""Tables that do not fit what `params.yaml` asks for: each fault is told, or changes nothing."""

import random
from pathlib import Path

import numpy as np
import pytest
from small_project import COMPARE, make_params, read_csv, write_csv, write_project
from table_faults import STRUCTURE, faults

from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison, timing
from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.results import load
from jumping_ant.evaluation import episodes
from jumping_ant.training import curves

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1]
PARAMS = make_params(AGENTS, SEEDS)
PGPE, TIMING = Path("results/agents/pgpe"), Path("results/timing/pgpe")
TABLES = {
    PGPE / "episodes.csv": "evaluate@pgpe",
    PGPE / "variants.csv": "evaluate@pgpe",
    TIMING / "timing.csv": "train@pgpe",
    Path("models/pgpe/seed-3/curve.csv"): "train@pgpe",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_project(tmp_path, AGENTS, SEEDS)
    return tmp_path


def compared(root: Path) -> object:
    """All numbers and verdicts, those on seconds as well."""
    agents = load(root, PARAMS, curves.read_timed)
    claims = verdicts.check(agents, COMPARE, PARAMS.training.evaluation_episodes)
    summary = comparison.summarize(agents, COMPARE)
    timed = timing.summarize(PARAMS, agents, summary, dict.fromkeys(AGENTS, {}))
    return summary, claims, comparison.seed_rows(agents), timed


@pytest.mark.parametrize("table", TABLES, ids=str)
def test_a_fault_is_told_or_changes_nothing_but_by_numbers(project: Path, table: Path) -> None:
    """Numbers that a table may hold change results, however large; nothing is a traceback."""
    expected, content = compared(project), (project / table).read_bytes()
    silent, refused = [], 0
    for seed in range(2):
        for kind, name, changed in faults(content, random.Random(seed)):
            (project / table).write_bytes(changed)
            try:
                if compared(project) != expected and kind == STRUCTURE:
                    silent.append((seed, name))
            except InputError as error:
                refused += kind == STRUCTURE
                assert "\n" not in str(error)
                if kind == STRUCTURE:
                    assert str(project / table) in str(error)
                    assert f"; run `dvc repro --force {TABLES[table]}`" in str(error)
    assert silent == []
    assert refused > 2 * 15


@pytest.mark.parametrize(
    ("one", "other", "table", "fault"),
    [
        ("models/sac/seed-3", "models/sac/seed-1", "/curve.csv", "column seed: given '1'"),
        ("models/dqn", "models/sac", "/seed-3/curve.csv", "column agent: given 'sac'"),
        *(
            (
                f"results/{place}",
                f"results/{place.replace('dqn', 'sac')}",
                "",
                "column agent: given",
            )
            for place in (
                "agents/dqn/episodes.csv",
                "agents/dqn/variants.csv",
                "timing/dqn/timing.csv",
            )
        ),
    ],
)
def test_swapped_files_are_noticed(
    project: Path, one: str, other: str, table: str, fault: str
) -> None:
    (project / one).rename(project / "kept")
    (project / other).rename(project / one)
    (project / "kept").rename(project / other)
    with pytest.raises(InputError) as caught:
        compared(project)
    assert str(caught.value).startswith(f"{project}/{one}{table}: row 1, {fault}")


def test_rows_are_those_asked_for(project: Path) -> None:
    path = Paths(project).agent("sac").episodes
    rows = read_csv(path)
    write_csv(path, rows[:4] + rows[5:])
    with pytest.raises(InputError, match="given 0 rows of seed 1, episode 1, .* allowed: 1;"):
        episodes.read(project, PARAMS, "sac")
    write_csv(path, [*rows, rows[4]])
    with pytest.raises(InputError, match=r"given 2 rows of seed 1, episode 1, .* allowed: 1;"):
        episodes.read(project, PARAMS, "sac")
    write_csv(path, rows)
    later = PARAMS.evaluate.model_copy(update={"seed": 5})  # and 3 x 3 on
    with pytest.raises(InputError, match=r"given 0 rows of seed 3, episode 0, episode_seed 14,"):
        episodes.read(project, PARAMS.model_copy(update={"evaluate": later}), "sac")


def test_the_order_of_rows_changes_no_bit(project: Path) -> None:
    expected = compared(project)
    for path in (Paths(project).agent("sac").episodes, Paths(project).agent("sac").variants):
        write_csv(path, read_csv(path)[::-1])
    assert compared(project) == expected


def test_a_cut_training_is_noticed(project: Path) -> None:
    """Even if both its tables end at the same evaluation."""
    curve = Paths(project).agent("dqn").seed(3).curve
    timing = Paths(project).agent("dqn").timing
    rows = read_csv(curve)
    steps = {row["env_steps"] for row in rows[-2:]}
    write_csv(curve, rows[:-2])
    kept = [r for r in read_csv(timing) if (r["seed"], r["env_steps"] in steps) != ("3", True)]
    write_csv(timing, kept)
    with pytest.raises(InputError, match="given an end after 750 control steps and 375 updates"):
        load(project, PARAMS)
    write_csv(curve, rows[:-1])
    with pytest.raises(InputError, match="allowed: an evaluation at the end of the agent's budget"):
        curves.read(project, PARAMS, "dqn", 3)


@pytest.mark.parametrize(
    ("table", "column", "cell", "fault"),
    [
        ("agents/sac/episodes", "length", "1001", "1001', allowed: a whole number from 1 to 1000"),
        ("agents/sac/episodes", "length", "9.5", "9.5', allowed: a whole number from 1 to 1000"),
        ("agents/sac/episodes", "flight", "1.5", "1.5', allowed: a number from 0 to 1"),
        ("agents/sac/episodes", "torque_change", "", "nan', allowed: a number from 0 to 4"),
        (
            "agents/sac/episodes",
            "fluidity",
            "-inf",
            "-inf', allowed: a number from -1e+30 to 0, ",
        ),
        ("agents/sac/episodes", "return", "1_000", "1_000', allowed: a number from -1e+30 to 1e"),
        ("agents/sac/variants", "variant", "best", "best', allowed: final, signed, three, rounded"),
        ("timing/sac/timing", "seconds", "-1", "-1.0', allowed: a number from 0 to 1e+09"),
    ],
)
def test_a_cell_out_of_its_range_is_named(
    project: Path, table: str, column: str, cell: str, fault: str
) -> None:
    path = project / "results" / f"{table}.csv"
    rows = read_csv(path)
    rows[1][column] = cell
    write_csv(path, rows)
    with pytest.raises(InputError) as caught:
        compared(project)
    assert str(caught.value).startswith(f"{path}: row 2, column {column}: given '{fault}")


def test_numbers_are_read_to_the_last_bit(tmp_path: Path) -> None:
    numbers = [0.1 + 0.2, 1 / 3, 5e-324, 1e23, 2.0**53, 123456.78901234567, -0.0]
    path = tmp_path / "a.csv"
    write_csv(path, [{"agent": "a", "x": number, "y": 7} for number in numbers])
    table = tables.read(path, "train", {"agent": "a"}, {"x": tables.ANY, "y": tables.SEED})
    assert table["x"].tobytes() == np.array(numbers).tobytes()
    assert table["y"].dtype == float


def test_seconds_of_a_learner_grow_from_its_first_row(project: Path) -> None:
    path = Paths(project).agent("sac").timing
    rows = read_csv(path)
    for cell in ("0", "99"):
        write_csv(path, [rows[0] | {"seconds": cell}, *rows[1:]])
        with pytest.raises(InputError, match="given seconds that are 0 or shrink"):
            compared(project)
    write_csv(path, [rows[0] | {"seconds": "0.001"}, *rows[1:]])
    compared(project)
