"""What agents keep of their return under perturbations."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_project import make_params, play_only, write_perturbed, write_project

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import retention
from jumping_ant.comparison.results import load
from jumping_ant.evaluation import perturbed
from jumping_ant.params.model import Params
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.perturbations import NONE, Condition

AGENTS = {"beat": "open_loop", "sac": "sac", "pgpe": "pgpe", "random": "random"}
SEEDS = list(range(8))
NOISE = np.random.default_rng(0).normal(0, 0.01, 100)


@pytest.fixture
def params(monkeypatch: pytest.MonkeyPatch) -> Params:
    play_only(monkeypatch, gravity=[1.5, 2.0000001, 3.0], observation_delay=[1, 2, 3, 4])
    return make_params(AGENTS, SEEDS)


def kept(name: str, condition: Condition, seed: int) -> float:
    """Gravity takes a tenth per unit of all; delays overtake SAC from the second, PGPE never."""
    luck = NOISE[seed + 10 * list(AGENTS).index(name)]
    if condition.perturbation == "gravity":
        return 1 - 0.1 * condition.level + luck
    if condition.perturbation == "observation_delay" and name != "beat":
        return 1.1 - (0.1 if name == "sac" else 0.01) * condition.level + luck
    return (0.95 if name == "beat" else 1.0) + luck


@pytest.fixture
def project(tmp_path: Path, params: Params) -> Path:
    write_project(tmp_path, AGENTS, SEEDS)
    write_perturbed(tmp_path, params, kept)
    return tmp_path


def test_all_levels_are_played_from_the_first_starts_of_each_block(params: Params) -> None:
    played = list(perturbed.cases(params, "sac"))
    conditions = list(dict.fromkeys(case.condition for case in played))
    assert conditions[0] == NONE and len(conditions) == 1 + 3 + 4
    usual = params.evaluate.baseline_episodes
    for condition in conditions:
        for seed in SEEDS:
            starts = [own.start for own in played if own[:2] == (condition, seed)]
            count = usual if condition == NONE else 1
            assert starts == list(params.evaluate.block(seed)[:count])
    assert list(perturbed.cases(params, "random")) == []


def test_the_table_is_read_as_it_was_written(project: Path, params: Params) -> None:
    read = perturbed.read(project, params, "sac")
    assert list(read) == perturbed.conditions()
    for condition, returns in read.items():
        expected = [1000 * kept("sac", condition, number) for number in range(len(SEEDS))]
        assert returns == pytest.approx(expected, abs=0.006)
    assert perturbed.read(project, params, "random") == {}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            lambda text: text.replace("gravity,2.0000001,3,", "gravity,2.000001,3,"),
            "given 0 rows of perturbation gravity, level 2.0000001, seed 3, episode_seed ",
        ),
        (lambda text: text.replace("gravity", "levity"), "given 'levity', allowed: none, torso_"),
        (lambda text: text[:-4], "its last line is cut off"),
        (lambda text: text.replace("sac,", "pgpe,"), "column agent: given 'pgpe'"),
    ],
)
def test_another_table_is_refused(
    project: Path, params: Params, change: Callable[[str], str], told: str
) -> None:
    path = Paths(project).perturbed("sac")
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(InputError, match="dvc repro --force robustness@sac") as caught:
        perturbed.read(project, params, "sac")
    assert told in str(caught.value)


def test_the_level_of_half_is_one_that_lasts() -> None:
    shares = {1.0: 0.4, 2.0: 0.9, 3.0: 0.45, 4.0: 0.2}  # below one half at once, but not for good
    own = {Condition("gravity", level): np.full(4, 1000 * share) for level, share in shares.items()}
    own[NONE] = np.full(4, 1000.0)
    found = retention.withstood(own, 0.95)["gravity"]
    assert found["level"] == list(shares)
    assert found["retention"] == pytest.approx(list(shares.values()))
    assert (found["half"], found["worst"]) == (3.0, pytest.approx(0.2))


@pytest.mark.parametrize(("usual", "share"), [([1000.0, -5.0], 0.5), ([0.0, -5.0], None)])
def test_a_seed_that_returns_nothing_keeps_nothing_that_counts(
    usual: list[float], share: float | None
) -> None:
    own = {NONE: np.array(usual), Condition("gravity", 2.0): np.array([500.0, 7.0])}
    found = retention.withstood(own, 0.95)["gravity"]
    assert (found["retention"], found["low"], found["worst"]) == ([share], [share], share)


def test_the_summary_says_who_withstands_what(project: Path, params: Params) -> None:
    found = retention.summarize(retention.read(project, params), 0.95)
    json.dumps(found, allow_nan=False)
    assert found["perturbations"] == ["gravity", "observation_delay"]
    assert set(found["agents"]) == {"beat", "sac", "pgpe"}
    assert found["agents"]["sac"]["observation_delay"]["level"] == [1, 2, 3, 4]


def test_groups_are_means_over_their_levels(project: Path, params: Params) -> None:
    results = load(project, params)
    grouped = retention.with_groups(results, retention.read(project, params))
    assert grouped["random"] == results["random"]
    sac = grouped["sac"].quantities
    for seed in range(len(SEEDS)):
        usual = kept("sac", NONE, seed)
        for group, name in (("world", "gravity"), ("senses", "observation_delay")):
            shares = [
                kept("sac", Condition(name, float(level)), seed) / usual
                for level in LEVELS[name].values
            ]
            assert sac[f"retention_{group}"][seed] == pytest.approx(np.mean(shares), abs=1e-4)


def test_levels_go_from_mild_to_severe_and_are_four() -> None:
    for row in LEVELS.values():
        assert len(row.values) in (0, 4)
        assert list(row.values) in (sorted(row.values), sorted(row.values, reverse=True))
