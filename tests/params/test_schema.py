import json
from typing import Any

import jsonschema
import pytest
from changed_params import CONTENT, changed

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import schema

VALIDATOR = jsonschema.Draft202012Validator(json.loads(schema.text()))


def test_the_file_is_current() -> None:
    assert schema.PATH.read_text(encoding="utf-8") == schema.text(), "run `make generate`"


def test_the_parameters_fit_and_name_it() -> None:
    first = (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first == f"# yaml-language-server: $schema={schema.PATH.name}"
    jsonschema.Draft202012Validator.check_schema(VALIDATOR.schema)
    VALIDATOR.validate(CONTENT)


def test_every_key_is_explained() -> None:
    for block in [VALIDATOR.schema, *VALIDATOR.schema["$defs"].values()]:
        assert block["additionalProperties"] is False
        for name, key in block["properties"].items():
            assert key.get("description"), name


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("seeds", []),
        ("seeds", [1, 1]),
        ("robot.density", 0),
        ("robot.densty", 1.0),
        ("agents.sac.algorithm", "sarsa"),
        ("agents.sac.gamma", 2),
        ("agents.dqn.actions.kind", "torques"),
        ("agents.Big Name", CONTENT["agents"]["random"]),
        ("record.fps", True),
    ],
)
def test_a_mistake_is_marked(path: str, value: Any) -> None:
    assert not VALIDATOR.is_valid(changed(path, value))
