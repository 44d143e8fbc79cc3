"""The command that trains as the article did, and says which printed values come out."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.article import figures as article_figures
from jumping_ant.article import printed_values, reproduction
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.media.style import looks
from jumping_ant.params import presets
from jumping_ant.params.model import Params
from jumping_ant.sim import robot
from jumping_ant.training.driver import train
from scripts import article as command
from scripts import markdown, preset

TINY: dict[str, dict[str, Any]] = {
    "dqn": {"total_steps": 300, "learning_starts": 100, "buffer_size": 300, "net_arch": [8]},
    "sac": {"total_steps": 160, "learning_starts": 60, "buffer_size": 200, "net_arch": [8]},
    "pgpe": {"population_size": 2, "episode_steps": 3},
}


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Params]:
    """A project with the article's agents, each trained for moments on two seeds."""
    root = tmp_path_factory.mktemp("project")
    params = presets.load("article")
    agents = {name: params.agent(name).model_copy(update=TINY[name]) for name in TINY}
    training = params.training.model_copy(update={"evaluations": 1, "evaluation_episodes": 1})
    params = params.model_copy(
        update={
            "seeds": [3, 5],
            "agents": agents,
            "training": training,
            "env": params.env.model_copy(update={"max_episode_steps": 20}),
            "compute": params.compute.model_copy(update={"workers": 1}),
        }
    )
    write_text(root / "params.yaml", json.dumps(params.model_dump()))  # JSON is YAML
    write_text(root / "assets" / "edited.xml", robot.build(params.robot))
    for name in agents:
        train(root, params, name)
    return root, params


@pytest.fixture(scope="module")
def reproduced(tiny: tuple[Path, Params]) -> reproduction.Reproduction:
    return reproduction.reproduce(*tiny, num_tests=2)


def test_values_are_those_of_the_articles_tests(
    tiny: tuple[Path, Params], reproduced: reproduction.Reproduction
) -> None:
    for trace in reproduced.totals.values():
        assert trace.ours.shape == (2, 2, 1000)
        rewards = np.diff(trace.ours)
        assert rewards.min() > -1e-9 and rewards.max() < 10 + 1e-9
        assert len({*trace.ours[:, :, -1].ravel()}) == 4
    for name, trace in reproduced.fitness.items():
        assert trace.ours.shape == (2, 1, 100)
        curve = pd.read_csv(Paths(tiny[0]).agent("pgpe").seed(5).curve)
        assert trace.ours[1, 0, 59] == curve.loc[curve["updates"] == 60, name].item()


def test_the_contract_of_the_results(reproduced: reproduction.Reproduction) -> None:
    content = json.loads(json.dumps(reproduced.summary()))
    printed = content["printed"]
    values = {"dqn": 527.5, "sac": 8311.7, "pgpe": 110.4}
    assert {name: own["value"] for name, own in printed.items()} == values
    for own in printed.values():
        assert len(own["ours"]) == len(own["tests"]["reached"]) == 2
        assert own["percentile"] in (0, 50, 100)
        assert own["tests"]["each"] == (1 if own is printed["pgpe"] else 2)
        assert 0 <= own["probability"]["low"] <= own["probability"]["value"]
        assert own["probability"]["value"] <= own["probability"]["high"] <= 1
        assert own["reproduced"] is not False  # two seeds cannot say so
    control = printed["dqn"]["control"]
    assert (control["command"], control["epsilon"], control["tests"]["each"]) == (4, 0.05, 4)
    assert len(printed["dqn"]["points"]) == len(printed["sac"]["points"]) == 11
    assert printed["dqn"]["points"][-1]["ours"] == printed["dqn"]["ours"]
    best = printed["pgpe"]["traces"]["fitness_best"]
    assert [point["at"] for point in best] == [20, 40, 60, 80, 100]
    assert printed["pgpe"]["film"]["value"] == 5276.6  # 50,741.5 + 11,865 in 11,865 steps
    assert len(printed["pgpe"]["trained_normalizer"]["ours"]) == 2
    assert content["seeds"] == [3, 5]
    seconds = content["training"]["seconds"]
    hours = sum(map(sum, seconds.values())) / 7200
    assert content["training"]["hours_on_2_cores"] == pytest.approx(hours)
    assert all(len(own) == 2 and min(own) > 0 for own in seconds.values())


def test_the_table_of_printed_values_tells_what_came_out() -> None:
    beyond = reproduction.place(9.0, np.arange(8.0)[:, None])
    among = reproduction.place(200.0, np.repeat([[100.0, 300.0]], 10, axis=0))
    printed = {"dqn": beyond, "sac": among, "pgpe": beyond | {"film": among}}
    *_, dqn, sac, _, film = markdown.printed_table(printed).splitlines()
    assert dqn == (
        "| DQN's test, total of 1,000 steps | 9 | 3.5 [0, 7] | 0 of 8: 6 [0–26] % | 0.11 | open |"
    )
    assert sac.startswith("| SAC's test, total of 1,000 steps | 200 | 100 [100, 100] | 10 of 20: ")
    assert sac.endswith(" | 1 | yes |")
    assert film.startswith("| PGPE's film, ") and film.endswith("| yes |")


def test_figures_show_each_seed_and_what_was_printed(reproduced: reproduction.Reproduction) -> None:
    families = {name: ALGORITHMS[name].family for name in TINY}
    drawn = article_figures.draw(reproduced, looks(families))
    assert list(drawn) == ["dqn", "sac", "pgpe"]
    *seeds, printed = drawn["sac"].axes[0].lines
    assert [line.get_ydata()[-1] for line in seeds] == reproduced.totals["sac"].last()["ours"]
    points = zip(printed.get_xdata(), printed.get_ydata(), strict=True)
    assert dict(points) == printed_values.SAC_TOTALS
    assert printed.get_linewidth() > 2 * seeds[0].get_linewidth()
    assert [len(panel.lines) for panel in drawn["pgpe"].axes] == [3, 3, 3]
    for figure in drawn.values():
        content = article_figures.picture(figure)
        assert content.startswith(b"\x89PNG") and len(content) < 100_000


@pytest.fixture
def nine_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Further trainings by the preset, and a folder for results."""
    monkeypatch.setattr(command, "RESULTS", tmp_path)
    monkeypatch.setattr(command, "MORE_TESTS", tmp_path / "tests.csv")
    rows = [f"preset,{seed},0,{500 + seed}\npreset,{seed},1,540" for seed in reversed(range(9))]
    text = "\n".join(["run,seed,test,return", "original,3,0,1", *rows, ""])
    (tmp_path / "tests.csv").write_text(text, encoding="utf-8")


@pytest.mark.usefixtures("nine_runs")
def test_measuring_writes_into_the_project(
    tiny: tuple[Path, Params],
    reproduced: reproduction.Reproduction,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The nine runs are of other settings, and so do not count."""
    options = ["--measure", "--tests", "2", "--folder", str(tiny[0])]
    monkeypatch.setattr(sys, "argv", ["article", *options])
    command.main()
    content = json.loads((tmp_path / "article.json").read_text(encoding="utf-8"))
    is_articles, machine = content.pop("article_settings"), content.pop("machine")
    assert content == json.loads(json.dumps(reproduced.summary())), "the same models, tested alike"
    assert is_articles is False
    assert machine["cores"] >= 1 and machine["versions"]["mujoco"]
    pictures = sorted(path.name for path in (tmp_path / "article").iterdir())
    assert pictures == ["dqn.png", "pgpe.png", "sac.png"]
    assert "hours on 2 cores" in capsys.readouterr().out


@pytest.mark.usefixtures("nine_runs")
def test_dqns_value_rests_on_all_seeds_of_its_run(
    tiny: tuple[Path, Params],
    reproduced: reproduction.Reproduction,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    root, params = tiny
    monkeypatch.setattr(presets, "load", lambda name: params)
    monkeypatch.setattr(reproduction, "reproduce", lambda *_: reproduced)
    dqn = command.measure(root, 2)["printed"]["dqn"]
    assert dqn["ours"] == [500.0 + seed for seed in range(9)]
    assert dqn["tests"] == {"each": 2, "reached": [1] * 9}
    assert dqn["reproduced"] is True
    assert len(dqn["points"][-1]["ours"]) == 2 and dqn["control"]["tests"]["each"] == 4


@pytest.mark.usefixtures("nine_runs")
def test_a_part_is_measured_alone(
    tiny: tuple[Path, Params],
    reproduced: reproduction.Reproduction,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As it is among others, and the project's own results stay."""
    root, params = tiny
    monkeypatch.setattr(presets, "load", lambda name: params)
    options = ["--measure", "--tests", "2", "--folder", str(root), "--seeds", "5"]
    for name in ("dqn", "pgpe"):
        monkeypatch.setattr(sys, "argv", ["article", *options, "--agents", name])
        command.main()
        content = json.loads((root / "results" / "article.json").read_text(encoding="utf-8"))
        assert content["seeds"] == [5]
        assert list(content["printed"]) == list(content["training"]["seconds"]) == [name]
        assert content["printed"][name]["ours"] == reproduced.summary()["printed"][name]["ours"][1:]
        assert (root / "results" / "article" / f"{name}.png").is_file()
    assert [path.name for path in tmp_path.iterdir()] == ["tests.csv"]


@pytest.mark.parametrize(
    ("options", "seeds", "targets"),
    [
        ("", range(30, 38), []),
        ("--agents sac dqn", range(30, 38), ["train@dqn", "train@sac"]),
        ("--seeds 3 70 3", [3, 70], ["train@dqn", "train@sac", "train@pgpe"]),
    ],
)
def test_a_part_is_trained_alone(
    options: str, seeds: list[int], targets: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[Any] = []
    monkeypatch.setattr(preset, "run", lambda *given: ran.append(given))
    monkeypatch.setattr(command, "measure", lambda *_: {"training": {"hours_on_2_cores": 1}})
    monkeypatch.setattr(sys, "argv", ["article", *options.split()])
    command.main()
    ((folder, params, stages),) = ran
    assert folder == PROJECT_ROOT / ".presets" / "article"
    assert (params.seeds, list(stages)) == (list(seeds), targets)
    assert params.agents == presets.load("article").agents


def test_what_is_not_there_is_refused(
    tiny: tuple[Path, Params], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, params = tiny
    monkeypatch.setattr(sys, "argv", ["article", "--seeds", "-3"])
    with pytest.raises(InputError, match=r"--seeds: seeds\.0: .*given -3"):
        command.main()
    with pytest.raises(InputError, match="given no project, allowed: what `make article`"):
        command.measure(tmp_path, 2)
    with pytest.raises(InputError, match="--seeds: given 4, allowed: 3, 5, trained in"):
        command.measure(root, 2, seeds=[4])
    with pytest.raises(InputError, match=r"dqn/seed-9/final.zip: No such file"):
        reproduction.reproduce(root, params.model_copy(update={"seeds": [3, 9]}))
    monkeypatch.setattr(printed_values, "PGPE_TRACES", {"fitness_mean": {200: 1.0}})
    with pytest.raises(InputError, match="given 100 generations, allowed: 200 or more"):
        reproduction.reproduce(root, params, agents=["pgpe"], seeds=[3])
