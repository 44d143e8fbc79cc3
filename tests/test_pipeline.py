"""`dvc.yaml` against the code, and presets against `params.yaml`."""

import shlex
import shutil
from pathlib import Path

import pytest
from dvc.utils.hydra import apply_overrides
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT as ROOT
from jumping_ant.experiment import params_file, presets
from scripts import deps

STAGES = YAML(typ="safe").load((ROOT / "dvc.yaml").read_text())["stages"]


def test_code_dependencies_are_current() -> None:
    before = deps.PATH.read_text()
    assert deps.text(before) == before, "run `make deps`"


def test_code_dependencies_follow_the_imports() -> None:
    before = deps.PATH.read_text()
    without = "\n".join(line for line in before.splitlines() if "- jumping_ant/" not in line) + "\n"
    assert without != before == deps.text(without)


def test_training_depends_on_its_own_trainer_alone() -> None:
    listed = deps.code("train")
    assert deps.OWN_TRAINER in listed
    trainers = {path.parent.name for path in (ROOT / "jumping_ant/agents").glob("*/trainer.py")}
    assert trainers >= {agent.trainer for agent in params_file.load().agents.values()}
    assert not any(f"agents/{trainer}/" in name for name in listed for trainer in trainers)


@pytest.mark.parametrize("stage", sorted(set(STAGES) - {"train", *deps.QUICK}))
def test_what_takes_long_depends_on_files(stage: str) -> None:
    assert all(name.endswith(".py") for name in deps.code(stage))


@pytest.mark.parametrize("name", sorted(STAGES))
def test_every_stage_depends_on_the_locked_versions(name: str) -> None:
    assert "requirements.lock" in STAGES[name].get("do", STAGES[name])["deps"]


PRESETS = sorted(path.name for path in (ROOT / "presets").iterdir())


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_change_what_dvc_makes_of_them(preset: str, tmp_path: Path) -> None:
    file = Path(shutil.copy(ROOT / "params.yaml", tmp_path))
    words = shlex.split((ROOT / "presets" / preset).read_text())
    assert set(words[::2]) == {"-S"}
    apply_overrides(file, words[1::2])
    assert params_file.load() != presets.load(preset) == params_file.load(file)


def test_ablations_leave_one_thing_out_each() -> None:
    default, agents = params_file.load().agents, presets.load("ablations").agents
    assert agents["sac-unedited"] == default["sac"].model_copy(update={"robot": "unedited"})
    without = default["pgpe"].model_copy(update={"decrease_rewards_by": 0.0})
    assert agents["pgpe-plain"] == without
