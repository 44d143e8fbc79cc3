"""What a run will cost: stages that DVC finds stale, their work, and this machine's rates."""

import subprocess
from contextlib import chdir
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from jumping_ant.experiment import presets
from jumping_ant.experiment.models import Params
from jumping_ant.params import article
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from jumping_ant.training.checkpoint_key import checkpoint_key
from scripts import cost, rates, stale, workload
from scripts.rates import Rates, Took
from scripts.repro import Watch

BURN = 'python -c "import time; all(time.process_time() < 1 for _ in iter(int, 1))"'


@pytest.fixture(scope="module")
def smoke() -> Params:
    """Small budgets: two seeds, episodes of 60 control steps, one worker."""
    return presets.load("smoke")


@pytest.fixture
def pipeline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A pipeline of three stages: `late` needs what `burn` writes, and `other` nothing."""
    monkeypatch.chdir(tmp_path)
    subprocess.run(["dvc", "init", "-q", "--no-scm"], check=True)
    stages = {
        "burn": {"cmd": f"{BURN} && cp input made", "deps": ["input"], "outs": ["made"]},
        "late": {"cmd": "sleep 1; cp made last", "deps": ["made"], "outs": ["last"]},
        "other": {"cmd": "touch apart", "outs": ["apart"]},
    }
    with (tmp_path / "dvc.yaml").open("w", encoding="utf-8") as file:
        YAML().dump({"stages": stages}, file)
    (tmp_path / "input").write_text("1", encoding="utf-8")
    return tmp_path


def test_a_stage_is_stale_with_all_that_depends_on_it(pipeline: Path) -> None:
    from dvc.cli import main as dvc

    assert sorted(stale.look(pipeline)) == ["burn", "late", "other"]
    watch = Watch()
    watch.start()
    assert dvc(["repro", "--quiet", "late"]) == 0
    burn, late = watch.end()
    assert (burn.stage, late.stage) == ("burn", "late")
    assert burn.core_seconds > 1 and late.seconds > 1
    assert stale.look(pipeline, ["late"]) == []
    (pipeline / "input").write_text("2", encoding="utf-8")
    assert stale.look(pipeline, ["late"]) == ["burn", "late"]
    assert stale.look(pipeline, ["other"]) == ["other"]
    assert stale.written(pipeline / "dvc.lock") == {"burn": 1, "late": 1}


def test_a_question_leaves_the_projects_cache_alone(tmp_path: Path) -> None:
    from dvc.repo import Repo

    cache, digest = (
        tmp_path / ".dvc" / "cache" / "files" / "md5",
        "d3b07384d113edec49eaa6238ad5ff00",
    )
    cached = cache / digest[:2] / digest[2:]
    cached.parent.mkdir(parents=True)
    cached.write_text("foo\n", encoding="utf-8")
    with stale.shadow(tmp_path, None, []) as folder:
        (folder / "new").write_text("new", encoding="utf-8")
        with chdir(folder), Repo() as repo:
            repo.cache.local.check(digest)
            repo.add("new")
            assert len(list(repo.cache.local.all())) == 2
    assert [path for path in cache.rglob("*") if path.is_file()] == [cached]
    assert cached.read_text(encoding="utf-8") == "foo\n"


def test_episodes_cost_their_control_steps(smoke: Params) -> None:
    """SAC's seeds play 2 episodes of 60 control steps, of the policy and of 5 variants."""
    simulated = 2 * 6 * 2 * 60 * workload.STEP
    seconds, core_seconds = workload.load(smoke, "evaluate@sac", cores=4)
    assert seconds == pytest.approx(workload.START + simulated / 4)
    assert core_seconds == pytest.approx(workload.START + simulated)


def test_seeds_train_in_rounds_of_as_many_as_there_are_workers(smoke: Params) -> None:
    def seconds(num_seeds: int, trained: int = 0, **agent: int) -> float:
        learner = smoke.agents["sac"].model_copy(update=agent)
        changed = {"seeds": list(range(num_seeds)), "agents": {"sac": learner}}
        compute = smoke.compute.model_copy(update={"workers": 0})
        params = smoke.model_copy(update=changed | {"compute": compute})
        own = workload.load(params, "train@sac", 4, trained=trained)[0]
        return own - workload.LEARNER_START

    one_round = seconds(4)
    assert seconds(30 * 4) == pytest.approx(30 * one_round)
    assert 3 * one_round < seconds(15) <= 4 * one_round
    assert seconds(8, trained=4) == pytest.approx(one_round)
    long, longer = (seconds(4, total_steps=steps) for steps in (10**6, 2 * 10**6))
    assert longer == pytest.approx(2 * long, rel=0.01)


def test_rates_are_those_of_the_stages_most_like_it(tmp_path: Path) -> None:
    own = Rates(tmp_path)
    assert not own
    slow, fast = Took("sac", 60, 90, 20, 30), Took("pgpe", 10, 20, 20, 40)
    own.keep({"train@sac": slow, "train@pgpe": fast, "report": Took("", 5, 5, 10, 10)})
    own.keep({"train@sac": Took("sac", 50, 50, 5, 5)})  # too short to tell more
    own = Rates(tmp_path)
    assert own.of("train@sac", "sac") == (3, 3, True)
    assert own.of("train@another", "sac") == (3, 3, False)
    assert own.of("train@td3", "td3") == (3, 3, False)  # trained in the same way
    assert own.of("train@a2c", "a2c")[:2] == (70 / 40, 110 / 70)
    assert own.of("lineup", "")[0] == 75 / 50
    copy = tmp_path / ".presets" / "smoke"
    copy.mkdir(parents=True)
    assert Rates(copy).of("train@sac", "sac") == (3, 3, True)


@pytest.mark.parametrize("content", ["{", "[]", '{"machine": ["another", 2], "stages": {}}'])
def test_rates_of_other_machines_do_not_count(tmp_path: Path, content: str) -> None:
    (tmp_path / rates.FILE).write_text(content, encoding="utf-8")
    own = Rates(tmp_path)
    assert own.of("train@sac", "sac") == (own.speed, own.speed, False)
    assert 0.1 < own.speed < 100


def test_seeds_that_are_trained_do_not_count(tmp_path: Path, smoke: Params) -> None:
    assets, agent = tmp_path / "assets", smoke.agents["sac"]
    assets.mkdir()
    (assets / "edited.xml").write_text(robot.build(article.ROBOT), encoding="utf-8")
    assert stale.trained(tmp_path, tmp_path, smoke, "sac") == (0, False)
    world = World(robot.read(tmp_path, "edited"), smoke.env)
    kept = tmp_path / ".checkpoints" / "sac" / checkpoint_key(world, smoke.training, agent)
    kept.mkdir(parents=True)
    (kept / "seed-1.finished").touch()
    (kept / "seed-7.finished").touch()  # of which nobody asks
    assert stale.trained(tmp_path, tmp_path, smoke, "sac") == (1, True)
    assert stale.trained(tmp_path, tmp_path, smoke, "dqn") == (0, False)


def test_an_estimate_is_compared_with_what_ran() -> None:
    seconds = {"train@sac": 3 * 3600.0, "report": 60.0, "track": 600.0}
    known = [
        cost.Cost(stage, "", (20, 40), own, 2 * own, 1e9, True, is_whole=stage != "report")
        for stage, own in seconds.items()
    ]
    found = cost.Estimate(known, has_rates=True, speed=1.0)
    assert found.total == "3.2 hours, 6.37 core-hours, 3.00 GB written"
    ran = [cost.Ran("report", 90, 90), cost.Ran("train@sac", 1800, 3600)]
    assert found.compared(ran) == (
        "Estimated 3.0 hours, 6.03 core-hours; took 31.5 minutes, 1.02 core-hours."
    )
    assert found.told_by(ran) == {"train@sac": Took("", 1800, 3600, 20, 40)}
    assert cost.summary(["train@sac", "train@dqn", "report"]) == "train (2), report"
