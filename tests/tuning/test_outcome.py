"""What a study found: verdicts, tables, presets, what tuning is worth."""

import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import OpenPage
from small_study import RANGES, project, small_params

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file, presets
from jumping_ant.experiment.models import TUNING_SEEDS, Params
from jumping_ant.tuning import outcome, space, study, tune
from jumping_ant.tuning.objective import FRESH, SEARCH, Fault, Measured
from jumping_ant.tuning.space import space_of
from jumping_ant.tuning.verdict import AFTER, BEFORE, Fresh

GOOD = {"stdev_init": 0.5, "momentum": 0.8}


@pytest.fixture(autouse=True)
def small_ranges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(space.RANGES, "pgpe", RANGES)


def trained(monkeypatch: pytest.MonkeyPatch, gain: float, seconds: float = 1.0) -> None:
    """Have trainings return what a formula says: settings other than the agent's own gain."""

    def stream(start: Any, keys: Any, *_: Any) -> Any:
        for key in keys:
            job, _, starts, *_ = start(key).args
            gained = job.agent.stdev_init - 0.3
            noise = np.random.default_rng([job.seed, round(1e6 * abs(gained))]).normal(0, 10)
            returns = [1000 + noise + (gain if gained else 0) * min(1, gained + 0.5)] * len(starts)
            onset = (seconds if gained else 10.0) + noise / 100
            yield key, Measured(tuple(returns), 12.0, (onset - 0.1, onset))

    monkeypatch.setattr("jumping_ant.compute.jobs.stream", stream)


def run(root: Path, **tuning: Any) -> dict[str, Any]:
    tune.run(root, small_params(12, **{"fresh_seeds": 8} | tuning), "pgpe", say=lambda _: None)
    found: dict[str, Any] = json.loads(Paths(root).study("pgpe").summary.read_text("utf-8"))
    return found


def test_better_settings_become_a_preset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = project(tmp_path)
    trained(monkeypatch, gain=3000)
    found = run(root)
    assert found["verdict"] == "better" and found["p"] < 0.001
    assert found["low"] <= found["difference"] <= found["high"]
    assert found["after"] - found["before"] == pytest.approx(found["difference"], rel=0.02)
    paths = Paths(root).study("pgpe")
    tuned = presets.load(paths.preset.name, root).agents["pgpe"].model_dump()
    before = params_file.load(root / "params.yaml").agents["pgpe"].model_dump()
    assert {key: own for key, own in tuned.items() if own != before[key]} == found["settings"]
    assert found["settings"].keys() == RANGES.keys()
    trained(monkeypatch, gain=0)
    assert run(root, spread_penalty=0.0)["verdict"] == "equivalent"
    assert not paths.preset.exists(), "which an earlier study had found"


def test_worse_settings_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that won by luck: what is measured afterwards is another thing."""
    root = project(tmp_path)
    trained(monkeypatch, gain=3000)
    monkeypatch.setattr(Fresh, "run", lambda *_: None)
    notes = [{"return": 1000.0 + seed, "seconds": 1.0, "onset": (0.0, 1.0)} for seed in range(8)]
    less = [note | {"return": note["return"] - 800} for note in notes]
    monkeypatch.setattr(Fresh, "_noted", lambda self, which: notes if which == BEFORE else less)
    found = run(root)
    assert (found["verdict"], found["difference"]) == ("worse", -800)
    assert not Paths(root).study("pgpe").preset.exists()


def test_seconds_are_judged_by_their_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = project(tmp_path)
    trained(monkeypatch, gain=0, seconds=5.0)
    found = run(root, target_return=500.0)
    assert found["verdict"] == "better" and found["difference"] == pytest.approx(5, abs=0.5)
    assert found["evidence"].startswith("Median seconds to a return above 500")
    assert found["before"] - found["after"] == pytest.approx(found["difference"], abs=0.5)
    text = " ".join(Paths(root).study("pgpe").page.read_text(encoding="utf-8").split())
    assert re.search(
        r"[\d.]+ s with the settings of trial \d+, 10[\d.]* s with its own: saved", text
    )


def test_machines_share_the_fresh_seeds(tmp_path: Path) -> None:
    """Each takes what the other has not begun, and at last what it has not ended."""
    params = small_params(3, fresh_seeds=2)
    task = tune.task_of(Path(), params, "pgpe")
    with study.opened(f"{study.FILE}{tmp_path}/a.db", "one", "tpe", 0.01, None) as opened:
        fresh = Fresh(opened, task, params.compare, 4, 1, task.space.agent)
        one, other = fresh._left(), fresh._left()
        assert [next(one), next(other), next(one)] == fresh.keys[:3]
        opened.set_user_attr(fresh._name(fresh.keys[0]), {"fault": "diverged"})
        assert list(other) == [fresh.keys[3], fresh.keys[2]]


def test_a_fresh_seed_that_diverged_is_the_worst_of_all(tmp_path: Path) -> None:
    """Also where returns are negative, and where the others never get there."""
    params = small_params(3, fresh_seeds=8, target_return=500.0)
    timed = tune.task_of(Path(), params, "pgpe")
    tuning = timed.tuning.model_copy(update={"target_return": None})
    with study.opened(f"{study.FILE}{tmp_path}/a.db", "one", "tpe", 0.01, None) as opened:
        fresh = Fresh(opened, timed, params.compare, 4, 1, timed.space.agent)

        def stream(start: Any, keys: Any, *_: Any) -> Any:
            for which, seed in keys:
                own = Measured((-900.0 + seed,), 20.0 + seed, (5.0 + seed, 6.0 + seed))
                never = Measured((-990.0,), 20.0, (20.0, math.inf))
                diverges = which == AFTER and seed < 5
                yield (which, seed), Fault("diverged") if diverges else own if seed else never

        with pytest.MonkeyPatch.context() as monkeypatch:
            monkeypatch.setattr("jumping_ant.compute.jobs.stream", stream)
            fresh.run(1, lambda _: None)
        seconds = fresh.verdict()
        returns = replace(fresh, task=replace(timed, tuning=tuning)).verdict()
    assert seconds["verdict"] == "worse"
    assert seconds["seconds"][AFTER] == [27.0] * 5 + [25.0, 26.0, 27.0], "the largest budget"
    assert (seconds[BEFORE], seconds[AFTER]) == (10.5, 27.0), "in seconds, as their difference"
    assert seconds["difference"] < 0
    assert returns["returns"][AFTER] == [-990.0] * 5 + [-895.0, -894.0, -893.0]


def test_own_settings_that_win_need_no_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trained(monkeypatch, gain=-500)
    found = run(project(tmp_path))
    assert (found["best_trial"], found["settings"]) == (0, {})
    assert found["verdict"] == "unchanged"
    numbers = [found[key] for key in ("before", "after", "difference", "low", "high", "p")]
    assert numbers == [None] * 6, "nothing was trained for it"


def test_every_verdict_has_fresh_seeds_and_starts(tmp_path: Path) -> None:
    params = small_params(3)
    task = tune.task_of(Path(), params, "pgpe")
    seen: set[int] = set()
    for name, trial in itertools.product(("one", "two"), (1, 2)):
        with study.opened(f"{study.FILE}{tmp_path}/a.db", name, "tpe", 0.01, None) as opened:
            fresh = Fresh(opened, task, params.compare, 32, trial, task.space.agent)
            jobs = {key: fresh.work(key).args for key in fresh.keys}  # type: ignore[attr-defined]
        seeds = {key: job.seed for key, (job, *_) in jobs.items()}
        starts = {key: set(own) for key, (_, _, own, *_) in jobs.items()}
        assert seeds[BEFORE, 0] == seeds[AFTER, 0] != seeds[AFTER, 1]
        assert starts[BEFORE, 0] == starts[AFTER, 0] and starts[AFTER, 0].isdisjoint(
            starts[AFTER, 1]
        )
        used = set(seeds.values()).union(*starts.values())
        assert len(starts[AFTER, 0]) == 32 and used.isdisjoint(SEARCH) and used <= set(FRESH)
        assert seen.isdisjoint(used)
        seen |= used
        assert all(own.evaluation_seed not in used for _, own, *_ in jobs.values())
    assert set(SEARCH) <= set(TUNING_SEEDS) and set(FRESH) <= set(TUNING_SEEDS)


@pytest.mark.parametrize("num", range(1, 6))
def test_the_expected_best_is_that_of_all_choices(num: int) -> None:
    draws = [3.0, 1.0, 4.0, 1.0, 5.0]
    best = [max(own) for own in itertools.combinations(draws, num)]
    assert outcome.expected_best(draws, num) == pytest.approx(np.mean(best))


@pytest.mark.parametrize("name", ["td3", "bc"])
def test_a_preset_brings_an_agent_that_the_parameters_lack(name: str, tmp_path: Path) -> None:
    families = presets.load("families")
    own = space_of(name, families.agents[name])
    content = params_file.read(PROJECT_ROOT / "params.yaml")
    settings = {"learning_rate": 0.00123, "net_arch": [64, 64], "batch_size": 64}
    text = outcome.preset(name, own, settings, content)
    root = project(tmp_path)
    demonstrations = "-S +demonstrations.bc={agent:sac,steps:12000,episode_steps:200,"
    demonstrations += "tumbled_starts:0.25,seed:6000000}\n"
    write_text(root / "presets" / "tuned", text + demonstrations * (name == "bc"))
    tuned = presets.load("tuned", root).agents[name]
    assert tuned.model_dump() == families.agents[name].model_dump() | settings


def test_a_study_in_which_nothing_is_complete_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stream(start: Any, keys: Any, *_: Any) -> Any:
        return ((key, Fault("diverged")) for key in keys)

    monkeypatch.setattr("jumping_ant.compute.jobs.stream", stream)
    root = project(tmp_path)
    found = run(root)
    assert (found["verdict"], found["best_trial"], found["pruned"]) == ("open", None, 12)
    assert found["best_after"] == found["importance"] == {} and found["without_value"] == 12
    assert "No trial is complete." in Paths(root).study("pgpe").page.read_text(encoding="utf-8")


def test_settings_that_a_block_leaves_out_are_added(tmp_path: Path) -> None:
    params: Params = params_file.load()
    content = params.model_dump()
    del content["agents"]["sac"]["gamma"]
    text = outcome.preset("sac", space_of("sac", params.agents["sac"]), {"gamma": 0.9}, content)
    assert text == "-S +agents.sac.gamma=0.9\n"


def test_the_page_opens_without_a_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, open_page: OpenPage
) -> None:
    root = project(tmp_path)
    trained(monkeypatch, gain=3000)
    tune.run(root, small_params(12), "pgpe", "random", say=lambda _: None)
    found = run(root)
    path = Paths(root).study("pgpe").page
    visit = open_page(path.as_uri())
    text = visit.page.inner_text("body")
    assert "Better" in text and found["evidence"] in text
    for chart in ("history", "importance", "slice_0", "slice_1", "parallel", "fresh"):
        visit.page.locator(f"#{chart}").scroll_into_view_if_needed()
        visit.wait_for(f"document.querySelector('#{chart} svg') !== null")
    assert visit.page.locator("#trials tbody tr").count() == 12
    assert visit.requests == [path.as_uri()]
    assert visit.console_errors == [] and visit.page_errors == []
