"""The presets, as `dvc exp run $(cat presets/NAME)` takes them."""

import shlex
from functools import reduce
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from jumping_ant import params_file
from jumping_ant.files import PROJECT_ROOT
from jumping_ant.params import Params

PATHS = sorted((PROJECT_ROOT / "presets").iterdir())


def overrides(path: Path) -> dict[str, Any]:
    """Return the values that a preset sets, by dotted key."""
    words = shlex.split(path.read_text())
    assert set(words[::2]) == {"-S"}
    pairs = [word.partition("=") for word in words[1::2]]
    return {key: YAML(typ="safe").load(value) for key, _, value in pairs}


def apply(path: Path) -> Params:
    """Return the project's parameters with a preset's values."""
    settings = YAML(typ="safe").load((PROJECT_ROOT / "params.yaml").read_text())
    for key, value in overrides(path).items():
        *parents, last = key.split(".")
        block = reduce(lambda inner, name: inner[name], parents, settings)
        assert last in block, f"{key} is not in params.yaml"
        block[last] = value
    return params_file.check(settings)
