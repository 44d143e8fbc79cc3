"""`dvc.yaml` against the code, and presets against `params.yaml`."""

import re
import shutil
import subprocess
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
from stages import digest

STAGES = YAML(typ="safe").load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["stages"]


CODE = digest.code()


def names(stage: str) -> set[str]:
    """The files that a stage's digests cover."""
    return {str(path.relative_to(ROOT)) for path in CODE[stage]}


@pytest.mark.parametrize("name", sorted(set(STAGES) - {"digest"}))
def test_every_stage_depends_on_its_own_code(name: str) -> None:
    deps = STAGES[name].get("do", STAGES[name])["deps"]
    own = "train/${item.algorithm}" if name == "train" else f"code/{name}.json"
    assert f".inputs/{own}" in deps
    for stage in CODE:
        if stage.partition("-")[0] == name:
            assert {f"stages/{name}.py", "stages/__init__.py"} <= names(stage)


@pytest.mark.parametrize("name", sorted(set(STAGES) - {"digest", "check"}))
def test_every_other_stage_waits_for_the_check(name: str) -> None:
    assert STAGES["check"]["outs"] == [".inputs/checked"]
    assert ".inputs/checked" in STAGES[name].get("do", STAGES[name])["deps"]


def test_no_stage_but_the_last_ones_depends_on_a_clock_or_the_machine() -> None:
    apart = {"results/timing", "results/scaling.csv", "results/speed.json"}
    outs = {name: set(_paths(stage, "outs")) for name, stage in STAGES.items()}
    timed = {"results/timing/${key}/timing.csv", "results/timing/${key}/machines.json"}
    assert outs["train"] == {"models/${key}", "results/agents/${key}/training.json", *timed}
    assert outs["timing"] == apart - {"results/timing"}
    for name, stage in STAGES.items():
        reads = [dep for dep in _paths(stage, "deps") if dep.startswith(tuple(apart))]
        assert set(reads) == {
            "timing": {"results/timing"},
            "track": apart - {"results/scaling.csv"},
        }.get(name, set())
        assert "results" not in _paths(stage, "deps")


def _paths(stage: dict[str, Any], kind: str) -> list[str]:
    """Return a stage's dependencies or outputs, which may have options."""
    return [
        next(iter(one)) if isinstance(one, dict) else one
        for one in stage.get("do", stage).get(kind, [])
    ]


@pytest.mark.parametrize(
    ("told", "words", "agent"),
    [
        ("train@sac", [], "sac"),
        ("../dvc.yaml:train@sac", [], "sac"),  # DVC runs in a folder of the project
        ("train@sac", ["dqn"], "dqn"),
        ("", ["dqn"], "dqn"),
        ("build", ["dqn"], "dqn"),
    ],
)
def test_a_stage_is_for_the_agent_that_it_is_told(
    told: str, words: list[str], agent: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_STAGE", told)
    monkeypatch.setattr(sys, "argv", ["train", *words])
    assert stages.parse_agent("Train.")[0] == agent


def test_a_stage_for_no_agent_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DVC_STAGE", "build")
    monkeypatch.setattr(sys, "argv", ["train"])
    with pytest.raises(SystemExit, match="2"):
        stages.parse_agent("Train.")
    assert "the following arguments are required: agent" in capsys.readouterr().err


def test_every_algorithm_gets_the_digests_of_its_code() -> None:
    assert schema.PIPELINE.read_text(encoding="utf-8") == schema.pipeline(), "run `make generate`"
    assert {".inputs/train/random", ".inputs/train/sac"} < set(STAGES["digest"]["outs"])
    assert ".inputs/train/${key}/code.json" in STAGES["demonstrate"]["do"]["outs"]
    assert ".inputs/code/train-${key}.json" in STAGES["demonstrate"]["do"]["deps"]


def test_digests_are_of_what_imports_lead_to() -> None:
    assert "jumping_ant/agents/off_policy/lean/adam.py" in names("train-sac")
    assert "jumping_ant/sim/vector.py" in names("evaluate")
    assert "jumping_ant/report/template.html" in names("report")
    assert "jumping_ant/tracking/serving.py" in names("track")
    others = {"build": "comparison", "evaluate": "recording", "train-random": "tracking"}
    for stage, other in others.items():
        assert not any(name.startswith(f"jumping_ant/{other}/") for name in names(stage))


TRAINING = {name for name in CODE if name.startswith("train-")}


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
    keys = {
        name: (digest.key(name, own), digest.key(name, own, lock)) for name, own in CODE.items()
    }
    assert {name for name, (before, after) in keys.items() if before != after} == stages


def test_every_file_that_the_package_ships_is_code_or_a_page() -> None:
    listing = ["git", "ls-files", "jumping_ant", "stages"]
    listed = subprocess.run(listing, cwd=ROOT, encoding="utf-8", capture_output=True, check=True)
    suffixes = {Path(name).suffix for name in listed.stdout.splitlines()}
    assert suffixes == {".py", ".typed", *digest.PAGES}


@pytest.mark.parametrize("algorithm", sorted(ALGORITHMS))
def test_training_depends_on_its_own_package_alone(algorithm: str) -> None:
    own = ALGORITHMS[algorithm].package
    found = {name.split("/")[2] for name in names(f"train-{algorithm}") if "/agents/" in name}
    assert found & set(packages()) == {own}


def test_imitators_are_trained_after_whom_they_imitate(tmp_path: Path) -> None:
    for name in ("dvc.yaml", "params.yaml"):
        shutil.copy(ROOT / name, tmp_path)
    apply_overrides(
        tmp_path / "params.yaml",
        (ROOT / "presets" / "families").read_text(encoding="utf-8").split()[1::2],
    )
    graph = Repo.init(str(tmp_path), no_scm=True).index.graph
    stages = {stage.name: stage for stage in graph}

    def needed(name: str) -> set[str]:
        return {stage.name for stage in networkx.descendants(graph, stages[name])}

    assert needed("train@sac") == {"digest", "check", "build"}
    for agent in ("bc", "dagger"):
        others = {"digest", "check", "build", "train@sac", f"demonstrate@{agent}"}
        assert needed(f"train@{agent}") == others


PRESETS = sorted(path.name for path in (ROOT / "presets").iterdir())


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_change_params_yaml(preset: str) -> None:
    words = (ROOT / "presets" / preset).read_text(encoding="utf-8").split()
    assert set(words[::2]) == {"-S"}
    assert params_file.load() != presets.load(preset)


def test_a_replication_has_other_seeds_than_the_default() -> None:
    default, again = params_file.load(), presets.load("replicate")
    assert not set(again.seeds) & set(default.seeds) and len(again.seeds) == len(default.seeds)
    assert again.model_copy(update={"seeds": default.seeds}) == default


def test_the_thesis_is_a_part_of_the_families_on_the_seeds_of_the_replication() -> None:
    again, thesis, families = map(presets.load, ("replicate", "thesis", "families"))
    more = {name: own for name, own in thesis.agents.items() if name not in again.agents}
    assert again.model_copy(update={"agents": again.agents | more}) == thesis
    assert more.items() <= families.agents.items() and len(more) == 8


def test_ablations_leave_one_thing_out_each() -> None:
    default, agents = params_file.load().agents, presets.load("ablations").agents
    assert agents["sac-unedited"] == default["sac"].model_copy(update={"robot": "unedited"})
    without = default["pgpe"].model_copy(update={"decrease_rewards_by": 0.0})
    assert agents["pgpe-plain"] == without
