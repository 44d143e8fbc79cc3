"""What a stage depends on is the same at its end, or its results are not taken."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jumping_ant.base import effective_code
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import digest, write_json, write_text
from jumping_ant.params import inputs

PARAMS = "seeds: [0]\nagents:\n  a: {algorithm: sac, rate: 0.1}\n  b: {algorithm: sac, rate: 1.0}\n"
DVC = """
stages:
  train:
    foreach: ${agents}
    do:
      cmd: python -m stages.train
      params: [seeds, "agents.${key}"]
      deps: [assets, ".inputs/train/${item.algorithm}"]
  plain:
    cmd: python -m stages.plain
    deps: [params.yaml]
"""
CODE = "package/code.py"
Change = Callable[[Path], object]


def replaced(name: str, old: str, new: str) -> Change:
    def change(root: Path) -> None:
        path = root / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        write_text(path, text.replace(old, new))

    return change


def returned(name: str) -> Change:
    """Write something else, and then what was there, as a visit to another branch does."""

    def change(root: Path) -> None:
        text = (root / name).read_text(encoding="utf-8")
        write_text(root / name, text + "OTHER = 1\n")
        write_text(root / name, text)

    return change


@pytest.fixture
def root(tmp_path: Path) -> Path:
    write_text(tmp_path / "params.yaml", PARAMS)
    write_text(tmp_path / "dvc.yaml", DVC)
    write_text(tmp_path / "assets" / "robot.xml", "<mujoco/>")
    write_text(tmp_path / CODE, "X = 1\n")
    digest_code(tmp_path, numpy=np.__version__)
    return tmp_path


def digest_code(root: Path, **versions: str) -> None:
    files = {CODE: effective_code.digest(root / CODE)}
    write_json(root / ".inputs" / "train" / "sac" / "code.json", files | versions)
    write_json(root / ".inputs" / "code" / "files.json", {CODE: digest(root / CODE)})


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (replaced("params.yaml", "rate: 0.1", "rate: 0.2"), "params.yaml: agents.a"),
        (replaced("params.yaml", "[0]", "[0, 1]"), "params.yaml: seeds"),
        (replaced("params.yaml", "  a:", "  c:"), "params.yaml: agents.a"),
        (replaced("assets/robot.xml", "/", " /"), "assets/robot.xml"),
        (lambda root: write_text(root / "assets" / "other.xml", ""), "assets/other.xml"),
        (replaced(CODE, "1", "2"), CODE),
        (returned(CODE), CODE),
        (lambda root: (root / CODE).unlink(), CODE),
        (replaced(CODE, "X", "    X = ("), CODE),
        (lambda root: (root / CODE).write_bytes(b"\xff"), CODE),
        (replaced("dvc.yaml", "train:", "trains:"), "dvc.yaml: has no stage train@a"),
        (lambda root: write_text(root / "dvc.yaml", "<<<<<<< HEAD: ["), "dvc.yaml: has no stage"),
        (replaced("params.yaml", "a: {algorithm: sac, rate: 0.1}", "a: 1"), "dvc.yaml: has no s"),
        (lambda root: digest_code(root, numpy="1.0"), ".inputs/train/sac/code.json"),
        (lambda root: shutil.rmtree(root / ".inputs"), ".inputs/train/sac/code.json"),
        (replaced("params.yaml", "seeds: [0]", "seeds: ["), "params.yaml: not YAML"),
    ],
)
def test_what_changes_while_a_stage_runs_ends_it(root: Path, change: Change, named: str) -> None:
    with pytest.raises(InputError, match="^" + named) as caught, inputs.unchanged("train@a", root):
        change(root)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        replaced("params.yaml", "rate: 1.0", "rate: 2.0"),  # another agent's
        replaced("params.yaml", "seeds", "# Numbers.\nseeds"),
        replaced("params.yaml", "rate: 0.1", "rate: 1e-1"),
        replaced(CODE, "X", "# A comment.\nX"),
        returned("params.yaml"),  # read once, before
        returned("assets/robot.xml"),
        lambda root: write_text(root / "package" / "__pycache__" / "code.pyc", ""),
        lambda root: write_text(root / "assets" / ".robot.xml.swp", ""),
        lambda root: write_text(root / "assets" / "robot.xml~", ""),
        lambda root: os.symlink("nothing", root / "assets" / "link"),
    ],
)
def test_what_it_does_not_use_may_change(root: Path, change: Change) -> None:
    with inputs.unchanged("train@a", root):
        change(root)


def test_code_is_what_was_digested_when_a_stage_begins(root: Path) -> None:
    replaced(CODE, "X", "# A comment.\nX")(root)
    inputs.read("train@a", root)
    (root / ".inputs" / "code" / "files.json").unlink()  # DVC pulls only what a stage lists
    inputs.read("train@a", root)
    digest_code(root, numpy="1.0")
    with pytest.raises(InputError, match="numpy: given version .*, allowed: 1.0, as in requireme"):
        inputs.read("train@a", root)
    digest_code(root)
    replaced(CODE, "1", "2")(root)
    with pytest.raises(InputError, match=f"{CODE}: changed since this run digested the code"):
        inputs.read("train@a", root)


def test_a_stage_of_the_whole_file_notices_that_it_changes(root: Path) -> None:
    with pytest.raises(InputError, match="params.yaml: changed"), inputs.unchanged("plain", root):
        replaced("params.yaml", "rate: 1.0", "rate: 2.0")(root)


def test_a_large_file_is_told_by_what_the_system_says(root: Path) -> None:
    path = root / "assets" / "large"
    path.write_bytes(bytes(inputs.SMALL))
    with pytest.raises(InputError, match="assets/large: ch"), inputs.unchanged("train@a", root):
        path.write_bytes(bytes(inputs.SMALL))
