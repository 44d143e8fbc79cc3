"""Later looks at open claims, with more seeds."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from small_field import (
    HIGH,
    LOW,
    METRONOME,
    OPEN_LOOP,
    RANDOM,
    TORN,
    agent,
    check,
    having,
)
from small_project import COMPARE, make_params, write_project

from jumping_ant.base.errors import InputError
from jumping_ant.comparison import results
from jumping_ant.comparison.claims import verdicts
from jumping_ant.experiment import presets
from scripts import decide

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7]
LEVELS = [0.04, 0.005, 0.005]
PARAMS = make_params(AGENTS, SEEDS)
PARAMS = PARAMS.model_copy(update={"compare": COMPARE.model_copy(update={"levels": LEVELS})})


def again(earlier, *agents, level=0.005):
    compare = COMPARE.model_copy(update={"levels": [0.05, level]})
    return verdicts.check_again(earlier, {one.name: one for one in agents}, compare, 2, 1)


def test_open_claims_are_tested_again_with_the_level_of_the_look():
    earlier = check(agent("dqn", "dqn", TORN), METRONOME)
    assert earlier[0]["verdict"] == "inconclusive"
    more = agent("dqn", "dqn", np.concatenate([TORN, HIGH, HIGH + 1])), METRONOME
    (claim,) = again(earlier, *more)
    assert (claim["look"], 0.0001 < claim["p_adjusted"] < 0.005) == (1, True)
    assert claim["verdict"] == "supported"
    (claim,) = again(earlier, *more, level=0.0001)
    assert claim["verdict"] == "inconclusive"


def test_verdicts_that_were_given_stand_and_do_not_count():
    open_one = agent("open", "dqn", TORN)
    earlier = check(agent("dqn", "dqn", HIGH), open_one, METRONOME)
    assert [claim["verdict"] for claim in earlier] == ["supported", "inconclusive"]
    found = again(earlier, agent("dqn", "dqn", LOW / 9), open_one, METRONOME)
    assert found[0] == earlier[0]
    # The first claim's equivalence is left, so that two claims still count.
    assert found[1]["p_adjusted"] == pytest.approx(min(1.0, 2 * found[1]["p"]))
    sac, dqn = (
        having(agent(name, name, returns), fluidity=np.linspace(start, start + 1, 8))
        for name, returns, start in (("sac", HIGH, 0.2), ("dqn", LOW, 0.0))
    )
    earlier = check(sac, dqn)
    found = again(earlier, sac, dqn)
    assert [claim["verdict"] for claim in found] == ["inconclusive", "supported", "supported"]
    # But for the two of fluidity, all hypotheses are rejected: one claim counts.
    assert earlier[0]["p_adjusted"] == pytest.approx(min(1.0, earlier[0]["p"]))
    assert found[0]["p_adjusted"] == pytest.approx(found[0]["p"]) != 1.0


def test_an_equivalence_that_was_rejected_beside_a_difference_does_not_count():
    small = np.linspace(500.0, 501.0, 8)
    open_one, alike = agent("open", "dqn", TORN), agent("alike", "open_loop", small)
    sure = agent("dqn", "dqn", small + 3)  # by less than the margin
    earlier = check(sure, open_one, alike)
    assert [claim["verdict"] for claim in earlier] == ["supported", "inconclusive"]
    assert earlier[0]["p_equivalence_adjusted"] < 0.001
    found = again(earlier, sure, open_one, alike)
    assert found[1]["p_adjusted"] == pytest.approx(found[1]["p"]) != 1.0


def test_what_is_left_of_a_claim_counts_by_the_level_of_its_look():
    """Rejected at 0.05, which the first look would do and the second, of 0.005, does not."""
    same = np.linspace(500.0, 501.0, 8)
    open_one, alike = agent("open", "dqn", TORN), agent("alike", "open_loop", same)
    earlier = check(agent("dqn", "dqn", same + 3), open_one, alike)
    earlier[0] |= {"p_equivalence_adjusted": 0.02}
    k = {}
    for look in (0, 1):
        found = again([earlier[0] | {"look": look}, earlier[1]], open_one, alike)
        k[look] = found[1]["p_adjusted"] / found[1]["p"]
    assert k == pytest.approx({0: 1.0, 1: 2.0})


def test_imitators_get_no_later_looks():
    """Their seeds would imitate another policy, even where their demonstrator gets more seeds."""
    sac, dqn = agent("sac", "sac", TORN), agent("dqn", "dqn", TORN)
    parrot = replace(agent("parrot", "bc", TORN), demonstrator="sac")
    agents = {one.name: one for one in (sac, dqn, parrot, RANDOM)}
    earlier = check(*agents.values())
    assert {claim["verdict"] for claim in earlier} == {"inconclusive"}
    looked_at = [claim for claim in earlier if verdicts.gets_later_looks(claim, agents)]
    (left,) = [claim for claim in earlier if claim not in looked_at]
    assert left["statement"] == 16
    found = again(earlier, *agents.values())
    assert [claim for claim in found if "look" not in claim] == [left]


def test_a_claim_that_cannot_be_tested_again_stays_open():
    earlier = check(agent("dqn", "dqn", TORN), METRONOME)
    other = agent("faster", "open_loop", LOW)
    assert again(earlier, agent("dqn", "dqn", HIGH), other) == earlier


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_project(tmp_path, AGENTS, SEEDS)
    return tmp_path


def test_agents_of_open_claims_get_seeds_until_the_last_look(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder, calls = tmp_path_factory.mktemp("copy"), []

    def train(copy: Path, params, targets) -> None:
        calls.append((params.seeds, list(params.agents), list(targets)))
        write_project(copy, {name: AGENTS[name] for name in params.agents}, params.seeds)

    found = decide.decide(project, folder, PARAMS, train)
    json.dumps(found, allow_nan=False)
    seeds, names, targets = calls[0]
    assert (seeds, set(names)) == (list(range(8, 16)), set(AGENTS))  # with three seeds all is open
    assert targets == [f"evaluate@{name}" for name in names]
    assert [look["level"] for look in found["looks"]] == [0.005, 0.005]
    assert found["looks"][0]["added_seeds"] == seeds
    assert calls[1][0] == list(range(8, 24))
    by_look = {claim.get("look"): claim for claim in found["claims"]}
    assert by_look[1]["verdict"] != "inconclusive"
    (jumps,) = [claim for claim in found["claims"] if OPEN_LOOP in claim["text"]] or [by_look[1]]
    assert len(next(iter(jumps["plot"]["values"].values()))) == 3 + 8
    still_open = {name for claim in found["claims"] if claim.get("look") == 2
                  for name in claim["agents"]}  # fmt: skip
    assert set(calls[1][1]) == still_open


def test_seeds_are_added_to_no_results_of_other_settings_or_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dvc.cli import main as dvc

    monkeypatch.chdir(tmp_path)
    subprocess.run(["dvc", "init", "-q", "--no-scm"], check=True)
    stages = {
        "evaluate": {"cmd": "cp settings episodes", "deps": ["settings"], "outs": ["episodes"]},
        "compare": {"cmd": "cp episodes compared", "deps": ["episodes"], "outs": ["compared"]},
        "report": {"cmd": "cp compared page", "deps": ["compared"], "outs": ["page"]},
    }
    with (tmp_path / "dvc.yaml").open("w", encoding="utf-8") as file:
        YAML().dump({"stages": stages}, file)
    (tmp_path / "settings").write_text("1", encoding="utf-8")
    assert dvc(["repro", "--quiet", "compare"]) == 0
    decide.refuse_stale(tmp_path)  # the report is no matter
    (tmp_path / "settings").write_text("2", encoding="utf-8")
    monkeypatch.setattr(decide, "PROJECT_ROOT", tmp_path)
    monkeypatch.setattr("sys.argv", ["decide", "--folder", str(tmp_path / "copy")])
    told = r"again: evaluate, compare\), allowed: up-to-date ones; run `make repro` first"
    with pytest.raises(InputError, match=told):
        decide.main()
    assert not (tmp_path / "copy").exists()


def test_nothing_is_trained_where_all_is_decided(project: Path) -> None:
    alone = PARAMS.model_copy(update={"agents": {"random": PARAMS.agents["random"]}})

    def train(*_: object) -> None:
        raise AssertionError

    assert decide.decide(project, project, alone, train) == {"looks": [], "claims": []}


def test_seeds_are_added_at_the_end(project: Path, tmp_path_factory) -> None:
    folder = tmp_path_factory.mktemp("copy")
    write_project(folder, {"sac": "sac"}, [8, 9])
    own = results.load(project, PARAMS)
    more = decide.with_more_seeds(PARAMS, {"sac"}, 1).model_copy(update={"seeds": [8, 9]})
    sac = results.joined(own, results.load(folder, more))["sac"]
    assert list(sac.curves) == [*SEEDS, 8, 9]
    returns = [3000.0, 3010.0, 3020.0, 3000.0, 3010.0]
    assert sac.quantities["return"] == pytest.approx(returns)
    assert sac.variants["final"]["return"] == pytest.approx(np.array(returns) - 7)
    assert len(sac.episodes["return"]) == 5 * 3
    assert len(own["sac"].quantities["return"]) == 3


def test_seeds_are_added_without_demonstrations() -> None:
    params = presets.load("families")
    more = decide.with_more_seeds(params, {"sac"}, 2)
    assert (list(more.agents), more.demonstrations) == (["sac"], {})
    assert more.seeds[0] == max(params.seeds) + 1
    assert len(more.seeds) == 2 * params.compare.look_seeds
