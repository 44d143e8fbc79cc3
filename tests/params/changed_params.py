"""The real `params.yaml` with something changed."""

import copy
from typing import Any

import pytest
from ruamel.yaml import YAML

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file

CONTENT = YAML(typ="safe").load((PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8"))
MISSING = object()


def changed(key: str, value: Any) -> dict[str, Any]:
    """Return the real parameters with one dotted key set, or taken away."""
    content = copy.deepcopy(CONTENT)
    *blocks, last = key.split(".")
    block = content
    for name in blocks:
        block = block[name]
    if value is MISSING:
        del block[last]
    else:
        block[last] = value
    return content


def refusal(content: Any) -> str:
    with pytest.raises(InputError) as caught:
        params_file.check(content)
    return str(caught.value)
