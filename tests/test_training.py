import csv
import hashlib
from pathlib import Path

import pytest

from jumping_ant import params, training
from jumping_ant.errors import InputError
from jumping_ant.params import Params

SMALL = {
    "dqn": {"total_steps": 640, "learning_starts": 100, "net_arch": [16], "log_interval": 160},
    "sac": {"total_steps": 240, "num_envs": 4, "net_arch": [16], "log_interval": 60},
    "pgpe": {"generations": 3, "population_size": 4, "episode_steps": 20},
}


def small_params(workers: int) -> Params:
    settings = params.load().model_dump()
    settings["seeds"] = [0, 5]
    settings["env"]["max_episode_steps"] = 40
    settings["training"]["evaluations"] = 2
    settings["compute"]["workers"] = workers
    for name, changes in SMALL.items():
        settings["agents"][name] |= changes
    return params.check(settings)


@pytest.fixture
def project(tmp_path: Path, robot_xml: str) -> Path:
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "jumping_ant.xml").write_text(robot_xml)
    return tmp_path


def digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_workers_change_no_byte(project: Path) -> None:
    """Inline and on Ray: models and curves are the same files."""
    runs = []
    for workers in (1, 2):
        for agent in SMALL:
            training.train(project, small_params(workers), agent)
        runs.append(digests(project / "models"))
    assert runs[0] == runs[1]
    assert len(runs[0]) == len(SMALL) * 2 * 2


@pytest.mark.parametrize("agent", sorted(SMALL))
def test_curve_and_timing(project: Path, agent: str) -> None:
    training.train(project, small_params(1), agent)
    for seed in (0, 5):
        curve = rows(project / "models" / agent / f"seed-{seed}" / "curve.csv")
        assert list(curve[0])[:7] == list(training.COLUMNS)
        steps = [int(row["env_steps"]) for row in curve]
        assert steps == sorted(steps)
        evaluated = [row for row in curve if row["evaluation_return_mean"]]
        assert len(evaluated) == 2
        assert all(row["return_mean"] == "" for row in evaluated), "one row, one kind of return"
        assert int(evaluated[-1]["env_steps"]) == steps[-1]
        timing = [row for row in rows(project / "results" / "timing" / f"{agent}.csv")]
        own = [row for row in timing if row["seed"] == str(seed)]
        assert [int(row["env_steps"]) for row in own] == steps
        seconds = [float(row["seconds"]) for row in own]
        assert seconds == sorted(seconds) and seconds[-1] > 0


def test_the_baseline_is_there_at_once(project: Path) -> None:
    training.train(project, small_params(2), "random")
    curve = rows(project / "models" / "random" / "seed-5" / "curve.csv")
    assert [row["env_steps"] for row in curve] == ["0"]
    assert float(curve[0]["evaluation_return_mean"]) >= 0


def test_unknown_agent_is_refused(project: Path) -> None:
    with pytest.raises(InputError, match="given 'nobody', allowed: random, dqn, sac, pgpe"):
        training.train(project, small_params(1), "nobody")
    assert not (project / "models").exists()


def test_missing_robot_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="dvc repro build"):
        training.train(tmp_path, small_params(1), "random")
