"""Tables that do not fit what `params.yaml` asks for: each fault is told, or changes nothing."""

import random
from pathlib import Path

import pytest
from small_project import COMPARE, make_params, read_csv, write_csv, write_project
from table_faults import NUMBERS, STRUCTURE, faults

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison, timing
from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.results import load
from jumping_ant.experiment import curves, episodes

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

WRITERS = {  # by folder and name
    ("agents", "episodes"): "evaluate",
    ("agents", "variants"): "evaluate",
    ("timing", "timing"): "train",
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
def test_a_fault_of_the_structure_is_told_or_changes_nothing(project: Path, table: Path) -> None:
    expected, content = compared(project), (project / table).read_bytes()
    silent, told = [], 0
    for seed in range(2):
        for kind, name, changed in faults(content, random.Random(seed)):
            (project / table).write_bytes(changed)
            if kind == NUMBERS:
                continue
            try:
                if compared(project) != expected:
                    silent.append((seed, name))
            except InputError as error:
                told += 1
                assert str(project / table) in str(error) and "\n" not in str(error)
                assert f"; run `dvc repro --force {TABLES[table]}`" in str(error)
    assert silent == []
    assert told > 2 * 20


@pytest.mark.parametrize("table", TABLES, ids=str)
def test_other_numbers_are_told_or_compared(project: Path, table: Path) -> None:
    """Those that a table may hold change results, however large; neither is ever a traceback."""
    content = (project / table).read_bytes()
    for seed in range(3):
        for kind, _, changed in faults(content, random.Random(seed)):
            if kind == STRUCTURE:
                continue
            (project / table).write_bytes(changed)
            try:
                compared(project)
            except InputError as error:
                assert "\n" not in str(error)


def swap(one: Path, other: Path) -> None:
    kept = one.with_name("kept")
    one.rename(kept)
    other.rename(one)
    kept.rename(other)


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        (
            "models/sac/seed-3",
            "models/sac/seed-1",
            "models/sac/seed-3/curve.csv: row 1: given one of agent sac, seed 1, allowed: rows of "
            "agent sac, seed 3; run `dvc repro --force train@sac`",
        ),
        (
            "models/dqn",
            "models/sac",
            "models/dqn/seed-3/curve.csv: row 1: given one of agent sac, seed 3, allowed: rows of "
            "agent dqn, seed 3; run `dvc repro --force train@dqn`",
        ),
        *(
            (
                f"results/{folder}/dqn/{name}.csv",
                f"results/{folder}/sac/{name}.csv",
                f"results/{folder}/dqn/{name}.csv: row 1: given one of agent sac, allowed: rows of "
                f"agent dqn; run `dvc repro --force {stage}@dqn`",
            )
            for (folder, name), stage in WRITERS.items()
        ),
    ],
)
def test_swapped_files_are_noticed(project: Path, one: str, other: str, said: str) -> None:
    swap(project / one, project / other)
    with pytest.raises(InputError) as caught:
        compared(project)
    assert str(caught.value) == f"{project}/{said}"


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
    ("table", "column", "cell", "allowed"),
    [
        ("episodes", "length", "1001", "a whole number from 1 to 1000"),
        ("episodes", "flight", "1.5", "a finite decimal number from 0 to 1"),
        ("episodes", "torque_change", "", "a finite decimal number from 0 to 4"),
        ("episodes", "fluidity", "-inf", "a finite decimal number from -1e+30 to 0, or none"),
        ("episodes", "return", "1_000", "a finite decimal number from -1e+30 to 1e+30"),
        ("variants", "variant", "best", "final, signed, three, rounded_full, rounded"),
        ("timing", "seconds", "-1", "a finite decimal number from 0 to 1e+09"),
    ],
)
def test_a_cell_out_of_its_range_is_named(
    project: Path, table: str, column: str, cell: str, allowed: str
) -> None:
    (folder,) = (folder for folder, name in WRITERS if name == table)
    path = project / "results" / folder / "sac" / f"{table}.csv"
    rows = read_csv(path)
    rows[1][column] = cell
    write_csv(path, rows)
    with pytest.raises(InputError) as caught:
        compared(project)
    said = f"{path}: row 2, column {column}: given {cell!r}, allowed: {allowed}; run `dvc repro"
    assert str(caught.value).startswith(said)


def test_seconds_of_a_learner_grow_from_its_first_row(project: Path) -> None:
    path = Paths(project).agent("sac").timing
    rows = read_csv(path)
    for cell in ("0", "99"):
        write_csv(path, [rows[0] | {"seconds": cell}, *rows[1:]])
        with pytest.raises(InputError, match="given seconds that are 0 or shrink"):
            compared(project)
    write_csv(path, [rows[0] | {"seconds": "0.001"}, *rows[1:]])
    compared(project)
