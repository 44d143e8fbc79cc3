"""`dvc.yaml` against the code, and presets against `params.yaml`."""

import re
import shutil
import sys
from pathlib import Path
from typing import Any

import networkx
import pytest
from dvc.repo import Repo
from dvc.utils.hydra import apply_overrides
from ruamel.yaml import YAML

import stages
from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.training_code import packages
from jumping_ant.base.files import PROJECT_ROOT as ROOT
from jumping_ant.params import params_file, presets, schema
from scripts import checkout
from stages import digest

STAGES = YAML(typ="safe").load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"]
STAGES = {name: stage.get("do", stage) for name, stage in STAGES.items()}
CODE = digest.code()
TRAINING = {name for name in CODE if name.startswith("train-")}
PRESETS = sorted(path.name for path in (ROOT / "presets").iterdir())


def names(stage: str) -> set[str]:
    """Return the files that a stage's digests cover."""
    return {str(path.relative_to(ROOT)) for path in CODE[stage]}


@pytest.mark.parametrize("name", sorted(set(STAGES) - {"digest"}))
def test_every_stage_depends_on_its_code_and_waits_for_the_check(name: str) -> None:
    code = "train/${item.algorithm}" if name == "train" else f"code/{name}.json"
    assert f".inputs/{code}" in STAGES[name]["deps"]
    assert name == "check" or ".inputs/checked" in STAGES[name]["deps"]
    for stage in CODE:
        if stage.partition("-")[0] == name:
            assert {f"stages/{name}.py", "stages/__init__.py"} <= names(stage)


def test_no_stage_but_the_last_ones_depends_on_a_clock_or_the_machine() -> None:
    apart = {"results/timing", "results/scaling.csv", "results/speed.json"}
    outs = {name: {*paths(stage, "outs")} for name, stage in STAGES.items()}
    timed = {"results/timing/${key}/timing.csv", "results/timing/${key}/machines.json"}
    assert outs["train"] == {"models/${key}", "results/agents/${key}/training.json", *timed}
    assert outs["timing"] == apart - {"results/timing"}
    for name, stage in STAGES.items():
        reads = {dep for dep in paths(stage, "deps") if dep.startswith(tuple(apart))}
        allowed = {"timing": {"results/timing"}, "track": apart - {"results/scaling.csv"}}
        assert reads == allowed.get(name, set())
        assert "results" not in paths(stage, "deps")


def paths(stage: dict[str, Any], kind: str) -> list[str]:
    """Return a stage's dependencies or outputs, which may have options."""
    return [next(iter(one)) if isinstance(one, dict) else one for one in stage.get(kind, [])]


@pytest.mark.parametrize(
    ("stage", "words", "agent"),
    [
        ("train@sac", [], "sac"),
        ("../dvc.yaml:train@sac", [], "sac"),  # DVC runs in a folder of the project
        ("train@sac", ["dqn"], "dqn"),
        ("", ["dqn"], "dqn"),
        ("build", [], None),
    ],
)
def test_a_stage_is_for_the_agent_that_dvc_or_a_word_names(
    stage: str, words: list[str], agent: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_STAGE", stage)
    monkeypatch.setattr(sys, "argv", ["train", *words])
    if agent:
        assert stages.parse_agent("Train.")[0] == agent
    else:
        with pytest.raises(SystemExit, match="2"):
            stages.parse_agent("Train.")


def test_every_algorithm_gets_the_digests_of_its_code() -> None:
    assert schema.PIPELINE.read_text(encoding="utf-8") == schema.pipeline(), "run `make generate`"
    assert {".inputs/train/random", ".inputs/train/sac"} < set(STAGES["digest"]["outs"])
    assert ".inputs/train/${key}/code.json" in STAGES["demonstrate"]["outs"]
    assert ".inputs/code/train-${key}.json" in STAGES["demonstrate"]["deps"]


def test_digests_are_of_what_imports_lead_to() -> None:
    assert "jumping_ant/agents/off_policy/lean/adam.py" in names("train-sac")
    assert "jumping_ant/sim/vector.py" in names("evaluate")
    assert "jumping_ant/report/template.html" in names("report")
    assert "jumping_ant/tracking/serving.py" in names("track")
    for stage, room in {
        "build": "comparison",
        "evaluate": "media",
        "train-random": "tracking",
    }.items():
        assert not any(name.startswith(f"jumping_ant/{room}/") for name in names(stage))


@pytest.mark.parametrize(
    ("library", "stages"),
    [
        ("plotly", {"report"}),
        ("torch", {"timing", *TRAINING}),
        ("pandas", set(CODE) - TRAINING - {"check", "build"}),
        ("evotorch", {name for name in TRAINING if ALGORITHMS[name[6:]].package == "evolution"}),
        ("sb3-contrib", {"train-qrdqn", "train-tqc", "train-crossq"}),
    ],
)
def test_a_librarys_version_reruns_what_imports_it(
    tmp_path: Path, library: str, stages: set[str]
) -> None:
    lock = tmp_path / "requirements.lock"
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    lock.write_text(re.sub(rf"^{library}==\S+", f"{library}==99", text, flags=re.M), "utf-8")
    changed = {it for it in CODE if digest.key(it, CODE[it]) != digest.key(it, CODE[it], lock)}
    assert changed == stages


def test_every_file_that_the_package_ships_is_code_or_a_page() -> None:
    listed = checkout.git("ls-files", "jumping_ant", "stages").splitlines()
    assert {Path(name).suffix for name in listed} == {".py", ".typed", *digest.PAGES}


@pytest.mark.parametrize("algorithm", sorted(ALGORITHMS))
def test_training_depends_on_its_own_package_alone(algorithm: str) -> None:
    parts = {name.split("/")[2] for name in names(f"train-{algorithm}") if "/agents/" in name}
    assert parts & set(packages()) == {ALGORITHMS[algorithm].package}


def test_imitators_are_trained_after_whom_they_imitate(tmp_path: Path) -> None:
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(ROOT / name, tmp_path)
    overrides = (ROOT / "presets" / "families").read_text(encoding="utf-8").split()[1::2]
    apply_overrides(tmp_path / "params.yaml", overrides)
    graph = Repo.init(str(tmp_path), no_scm=True).index.graph
    needed = {
        stage.name: {other.name for other in networkx.descendants(graph, stage)} for stage in graph
    }
    first = {"digest", "check", "build"}
    assert needed["train@sac"] == first
    for agent in ("bc", "dagger"):
        assert needed[f"train@{agent}"] == first | {"train@sac", f"demonstrate@{agent}"}


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_change_params_yaml(preset: str) -> None:
    words = (ROOT / "presets" / preset).read_text(encoding="utf-8").split()
    assert set(words[::2]) == {"-S"}
    assert params_file.load() != presets.load(preset)


def test_replications_have_other_seeds_and_the_thesis_is_one_with_more_of_the_families() -> None:
    default, again = params_file.load(), presets.load("replicate")
    assert not set(again.seeds) & set(default.seeds) and len(again.seeds) == len(default.seeds)
    assert again.model_copy(update={"seeds": default.seeds}) == default
    thesis, families = presets.load("thesis"), presets.load("families")
    more = {name: it for name, it in thesis.agents.items() if name not in again.agents}
    changed = {"agents": again.agents | more, "claims": "thesis"}
    assert again.model_copy(update=changed) == thesis
    half = {name: more.pop(name) for name in ("sac-half", "decqn-half")}
    assert more.items() <= families.agents.items() and len(more) == 7
    weak = {
        name: agent.model_dump() | {"actions": agent.actions.model_dump() | {"amplitude": 0.5}}
        for name, agent in (("sac", default.agents["sac"]), ("decqn", more["decqn"]))
    }
    longer = {"total_steps": 210000, "buffer_size": 70000}  # DQN's, and all that it sees
    assert half["sac-half"].model_dump() == weak["sac"] | longer
    assert half["decqn-half"].model_dump() == weak["decqn"]


def test_ablations_leave_one_thing_out_each() -> None:
    default, agents = params_file.load().agents, presets.load("ablations").agents
    assert agents["sac-unedited"] == default["sac"].model_copy(update={"robot": "unedited"})
    without = default["pgpe"].model_copy(update={"decrease_rewards_by": 0.0})
    assert agents["pgpe-plain"] == without
