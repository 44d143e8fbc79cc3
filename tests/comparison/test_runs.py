"""Somebody else's runs: read from a table, from TensorBoard and from MLflow, and judged."""

import sys
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym
import mlflow
import numpy as np
import pandas as pd
import pytest
from mlflow import MlflowClient
from stable_baselines3 import A2C

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.comparison import __main__ as command
from jumping_ant.comparison import runs
from jumping_ant.comparison.claims import judge
from jumping_ant.params import params_file
from jumping_ant.params.claims import Claim

CLAIMS = """
- {text: CrossQ returns more than SAC., measure: return, agent: CrossQ, against: SAC, margin: 100}
- {text: CrossQ learns sooner., measure: steps_to_learn, agent: CrossQ, against: SAC, side: less}
- {text: PPO returns more., measure: return, agent: PPO, against: SAC}
"""


def judged(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    monkeypatch.setattr(sys, "argv", ["comparison", *map(str, arguments)])
    command.main()


@pytest.fixture
def claims(tmp_path: Path) -> Path:
    write_text(tmp_path / "claims.yaml", CLAIMS)
    return tmp_path / "claims.yaml"


def test_a_public_table_is_judged(
    tmp_path: Path,
    claims: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table = pd.read_csv(PROJECT_ROOT / "docs" / "published" / "ant_v4.csv")
    table = table.rename(columns={"method": "agent", "env_steps": "step"})
    table = table[table.groupby("agent")["seed"].transform("count") == 10]
    path, page = tmp_path / "runs.csv", tmp_path / "page.html"
    table.to_csv(path, index=False)
    agents = runs.results(runs.from_csv(path))
    assert {name: agent.quantities["return"].tolist() for name, agent in agents.items()} == {
        name: own["return"].tolist() for name, own in table.groupby("agent", sort=False)
    }
    judged(monkeypatch, path, claims, "--page", page)
    told = capsys.readouterr().out
    assert "CrossQ returns more than SAC.\n  Return: CrossQ " in told
    assert "not asked: CrossQ learns sooner. (no random agent" in told
    assert "not asked: PPO returns more. (no agent PPO in this run)" in told
    text = page.read_text(encoding="utf-8")
    assert text.count("Plotly.newPlot(") == 4 and "CrossQ returns more than SAC." in text


def test_the_pooled_numbers_of_the_documents_are_those_of_the_returns_in_git() -> None:
    rows = runs.from_csv(PROJECT_ROOT / "results" / "earlier" / "returns.csv")
    agents = runs.results(rows)
    assert {len(agent.curves) for agent in agents.values()} == {48}
    asked = Claim(text="A.", measure="return", agent="pgpe", against="sac", margin=400)
    (entry,) = judge([asked], agents, params_file.load().compare)["claims"]
    told = "{value:.0f} [{low:.0f}, {high:.0f}]".format(**entry)
    for name in ("README.md", "docs/results.md"):
        text = " ".join((PROJECT_ROOT / name).read_text(encoding="utf-8").split())
        assert told in text or told.replace("-14 [", "14 less [") in text
    current = params_file.load()
    for name, agent in agents.items():  # those of the run that is in git are the same
        path = PROJECT_ROOT / "results" / "agents" / name / "seeds.csv"
        ours = pd.read_csv(path).set_index("seed")["return"]
        known = dict(zip(agent.curves, agent.quantities["return"], strict=True))
        shared = [seed for seed in current.seeds if seed in known]
        assert [known[seed] for seed in shared] == pytest.approx(ours[shared].tolist())


def rows(*agents: str, seeds: int = 3) -> str:
    lines = [
        f"{agent},{seed},{step},{step * (seed + 1)},{step / 10}"
        for agent in agents
        for seed in range(seeds)
        for step in (10, 20)
    ]
    return "\n".join(["agent,seed,step,return,seconds", *lines, ""])


def test_seconds_and_what_was_learned_are_asked_where_they_are_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_text(tmp_path / "runs.csv", rows("a", "b"))
    claim = "text: A learns sooner., measure: seconds_to_learn, agent: a, against: b, side: less"
    write_text(tmp_path / "claims.yaml", f"- {{{claim}}}\n")
    monkeypatch.chdir(tmp_path)
    judged(monkeypatch, "runs.csv", "claims.yaml", "--learned", 15)
    told = capsys.readouterr().out
    assert told.startswith("inconclusive: A learns sooner.") and "a 1 (3 of 3 seeds" in told
    assert (tmp_path / "comparison.html").exists()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda text: text.replace("step", "steps"), "given no column step, allowed: agent, seed,"),
        (lambda text: text.replace("10,10,", "10,ten,", 1), "row 1, return: given 'ten', allowed"),
        (lambda text: text.replace("10,10,", "10,inf,", 1), "row 1, return: given 'inf'"),
        (lambda text: text.replace("a,0,20", "a,0,10"), "a, seed 0: given a step twice"),
        (lambda text: text + "b,0,10,1,1\n", "b: given 1 seeds, allowed: 3, as many of each"),
        (lambda text: rows("a", seeds=1), "a: given 1 seeds, allowed: 2"),
        (lambda text: rows("a", seeds=0), "runs: given none"),
        (lambda text: "", "runs.csv: No columns to parse"),
        (lambda text: text.replace("a,0", '"a,0'), "row 1, agent: given 'a,0,10,"),
    ],
)
def test_what_cannot_be_judged_is_refused(
    tmp_path: Path, change: Callable[[str], str], told: str
) -> None:
    write_text(tmp_path / "runs.csv", change(rows("a")))
    with pytest.raises(InputError) as caught:
        runs.results(runs.from_csv(tmp_path / "runs.csv"))
    assert told in str(caught.value) and "\n" not in str(caught.value)


def test_a_folder_of_stable_baselines3_is_read(tmp_path: Path) -> None:
    lengths: dict[int, list[float]] = {}
    for seed in (1, 2):
        model = A2C(
            "MlpPolicy", gym.make("CartPole-v1"), seed=seed, tensorboard_log=str(tmp_path / "logs")
        )
        model.learn(600, log_interval=20)
        lengths[seed] = [episode["r"] for episode in model.ep_info_buffer]
    agents = runs.results(runs.from_tensorboard(tmp_path / "logs"))
    assert list(agents) == ["A2C"] and list(agents["A2C"].curves) == [1, 2]
    for seed, last in zip((1, 2), agents["A2C"].quantities["return"], strict=True):
        assert last == pytest.approx(np.mean(lengths[seed]))
        curve = agents["A2C"].curves[seed]
        assert curve["env_steps"].tolist() == [100, 200, 300, 400, 500, 600]
        assert (np.diff(curve["seconds"]) >= 0).all()
    with pytest.raises(InputError, match=r"given no x, allowed: .*rollout/ep_rew_mean"):
        runs.from_tensorboard(tmp_path / "logs", "x")
    with pytest.raises(InputError, match="given no TensorBoard files"):
        runs.from_tensorboard(tmp_path / "none")


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("DQN_1", ("DQN", 1)),
        ("sac/seed-30", ("sac", 30)),
        ("ppo-v2_seed_7", ("ppo-v2", 7)),
        ("a/b3", ("a/b", 3)),
    ],
)
def test_a_runs_name_ends_with_its_seed(name: str, parts: tuple[str, int]) -> None:
    assert runs.parted(name) == parts


@pytest.mark.parametrize("name", ["", "sac", "12"])
def test_a_name_without_a_seed_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="given no seed, allowed: an agent and a number"):
        runs.parted(name)


def test_an_experiment_of_mlflow_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path}/mlflow.db")
    client = MlflowClient(f"sqlite:///{tmp_path}/mlflow.db")
    experiment = client.create_experiment("theirs", str(tmp_path / "artifacts"))
    for seed in range(3):
        named = client.create_run(experiment, run_name=f"PPO_{seed}")
        tagged = client.create_run(experiment, tags={"agent": "SAC"})
        client.log_param(tagged.info.run_id, "seed", seed)
        for run, factor in ((named, 1.0), (tagged, 2.0)):
            for step in (1, 2):
                client.log_metric(run.info.run_id, "reward", factor * step + seed, step=step)
    agents = runs.results(command.rows("mlflow:theirs", "reward"))
    returns = {name: agent.quantities["return"].tolist() for name, agent in agents.items()}
    assert returns == {"PPO": [2.0, 3.0, 4.0], "SAC": [4.0, 5.0, 6.0]}
    with pytest.raises(InputError, match="given no run with evaluation_return_mean; --metric"):
        command.rows("mlflow:theirs", "")
    with pytest.raises(InputError, match="experiment: given 'ours', allowed: .*theirs"):
        command.rows("mlflow:ours", "")
    assert mlflow.active_run() is None
