"""The launcher's file in docs/cluster.md, by Ray's own rules."""

import re

import pytest
from ray.autoscaler._private.util import prepare_config, validate_config
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT

DOCUMENT = PROJECT_ROOT / "docs" / "cluster.md"


def test_ray_takes_the_launchers_file() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    (block,) = re.findall(r"^```yaml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    given = YAML(typ="safe").load(block)
    prepared = prepare_config(given)
    validate_config(prepared)
    assert prepared["max_workers"] == 2
    commands = [given["head_start_ray_commands"][-1], given["worker_start_ray_commands"][-1]]
    for command, shown in zip(
        commands, re.findall(r"^(ray start .*?)  ", text, re.MULTILINE), strict=False
    ):
        own = command.partition(".venv/bin/")[2].replace("$RAY_HEAD_IP", "HEAD")
        assert own == shown, "as it is typed by hand"
    with pytest.raises(Exception, match="worker_ip"):
        validate_config(prepared | {"worker_ip": []})
