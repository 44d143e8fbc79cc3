"""The workspace's agents beside those of another run."""

import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from small_project import make_params, read_csv, write_csv, write_project

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import __main__ as command
from jumping_ant.comparison import against
from jumping_ant.params import params_file
from jumping_ant.params.model import Params

AGENTS = {"dqn": "dqn", "sac": "sac", "pgpe": "pgpe", "random": "random", "mine": "sac"}
SEEDS = list(range(8))


def git(root: Path, *arguments: str) -> str:
    who = ("-c", "user.name=A", "-c", "user.email=a@example.org")
    command = ["git", "-C", str(root), *who, *arguments]
    return subprocess.run(command, check=True, capture_output=True, encoding="utf-8").stdout.strip()


def write_params(root: Path, params: Params) -> None:
    with Paths(root).params.open("w", encoding="utf-8") as file:
        YAML().dump(params.model_dump(), file)


def change(root: Path, agent: str, more: float) -> None:
    """Let an agent return more, each seed about as much."""
    path = Paths(root).agent(agent).episodes
    rows = [
        row | {"return": float(row["return"]) + more + 0.01 * int(row["seed"])}
        for row in read_csv(path)
    ]
    write_csv(path, rows)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A run that was committed, without `mine`; three agents have been retuned since."""
    whole = make_params(AGENTS, SEEDS)
    params = whole.model_copy(update={"agents": {**whole.agents}})
    del params.agents["mine"]
    write_project(tmp_path, AGENTS, SEEDS)
    write_params(tmp_path, params)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-qm", "My run")
    git(tmp_path, "tag", "first")
    change(tmp_path, "dqn", 50.0)
    change(tmp_path, "sac", -50.0)
    change(tmp_path, "pgpe", 3.0)
    write_params(tmp_path, whole)
    return tmp_path


def words(root: Path, revision: str) -> dict[str, str]:
    judged = against.judge(root, params_file.load(Paths(root).params), revision)
    return {name: word for name, (word, _) in judged.items()}


CHANGED = {
    "dqn": "better",
    "sac": "worse",
    "pgpe": "no difference of practical size",
    "random": against.SAME,
}


@pytest.mark.parametrize("revision", ["first", "HEAD", "master", "faster"])
def test_agents_are_judged_on_the_same_seeds_and_starts(project: Path, revision: str) -> None:
    git(project, "branch", "-M", "master")
    git(project, "update-ref", f"refs/exps/ab/{'c' * 38}/faster", "HEAD")
    assert words(project, revision) == CHANGED
    params = params_file.load(Paths(project).params)
    evidence = against.judge(project, params, revision)["dqn"][1]
    assert evidence.startswith("Return: DQN 785 [")
    assert "DQN, before 735 [" in evidence
    assert "mean difference of the same seeds 50 [50, 50.1] (sign-flip test: p = 0.0078" in evidence


def test_other_seeds_are_compared_as_such(project: Path) -> None:
    params = params_file.load(Paths(project).params)
    others = [seed + 100 for seed in SEEDS]
    write_project(project, AGENTS, others)
    change(project, "dqn", 500.0)
    judged = against.judge(project, params.model_copy(update={"seeds": others}), "first")
    assert {name: word for name, (word, _) in judged.items()} == {
        "dqn": "better", "sac": "open", "pgpe": "open", "random": "open"
    }  # fmt: skip
    assert "dqn before 735 [" in judged["dqn"][1] and "rank test" in judged["dqn"][1]


def test_the_command_prints_a_line_for_each(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "PROJECT_ROOT", project)
    monkeypatch.setattr(params_file.load, "__defaults__", (Paths(project).params,))
    monkeypatch.setattr(sys, "argv", ["comparison", "--against", "first"])
    command.main()
    told = capsys.readouterr().out.splitlines()
    assert [line for line in told if not line.startswith("  ")] == [
        f"{name}: {word}" for name, word in CHANGED.items()
    ]


@pytest.mark.parametrize("revision", ["nothing", "--help", "", "HEAD:params.yaml", "first^{tree}"])
def test_what_is_no_revision_is_refused(project: Path, revision: str) -> None:
    with pytest.raises(InputError, match="--against: given .*, allowed: a commit, tag or branch"):
        words(project, revision)


def test_a_commit_without_results_is_refused(project: Path) -> None:
    git(project, "rm", "-q", "--cached", "-r", "results")
    git(project, "commit", "-qm", "None")
    with pytest.raises(InputError, match=r"has no results/agents/dqn/episodes.csv: commit a run's"):
        words(project, "HEAD")
