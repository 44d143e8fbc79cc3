"""`dvc.yaml` against the code: every stage depends on all it imports, and on no more."""

import shlex
import shutil
from pathlib import Path

import pytest
from dvc.utils.hydra import apply_overrides
from ruamel.yaml import YAML

from jumping_ant import imports, params_file, presets

ROOT = Path(__file__).resolve().parents[1]
STAGES = YAML(typ="safe").load((ROOT / "dvc.yaml").read_text())["stages"]


def closure(*paths: Path) -> set[str]:
    """Return the project's files that files import, directly or not, themselves included."""
    return {str(file.relative_to(ROOT)) for file in imports.closure(*paths)}


def code_deps(stage: dict, trainer: str = "") -> set[str]:
    """Return the Python files among a stage's deps; a folder of code stands for its files."""
    files = set()
    for dep in stage.get("do", stage)["deps"]:
        path = ROOT / dep.replace("${item.trainer}", trainer)
        if path.suffix == ".py":
            files.add(path)
        elif dep.startswith("jumping_ant/"):
            files |= {file for file in path.rglob("*.py") if file.stat().st_size > 0}
    return {str(file.relative_to(ROOT)) for file in files}


@pytest.mark.parametrize("name", sorted(set(STAGES) - {"train"}))
def test_deps_are_the_import_closure(name: str) -> None:
    assert code_deps(STAGES[name]) == closure(ROOT / "stages" / f"{name}.py")


TRAINERS = sorted({agent.trainer for agent in params_file.load().agents.values()})


@pytest.mark.parametrize("trainer", TRAINERS)
def test_training_depends_on_its_own_trainer_alone(trainer: str) -> None:
    """Of the code outside `agents/`, dvc.yaml has one list for all: what any trainer imports."""
    needed = {
        name: closure(ROOT / "stages/train.py", ROOT / "jumping_ant/agents" / name / "trainer.py")
        for name in TRAINERS
    }
    shared = {file for files in needed.values() for file in files if "/agents/" not in file}
    own = {file for file in needed[trainer] if "/agents/" in file}
    assert own and code_deps(STAGES["train"], trainer) == shared | own


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
