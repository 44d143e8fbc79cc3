"""The JSON Schema of `params.yaml`, with which editors complete, explain and check it.

Usage: python -m jumping_ant.params.schema (`make generate`)
Writes: params.schema.json, which the first line of `params.yaml` points editors to, and in dvc.yaml
    the outputs of `digest`, one for each algorithm.
"""

import json
import re
from typing import Any

from jumping_ant.agents.catalogue import ALGORITHMS, demonstrated
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.params.model import Params

PATH = PROJECT_ROOT / "params.schema.json"
PIPELINE = PROJECT_ROOT / "dvc.yaml"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def text() -> str:
    """Return the schema of the models in `jumping_ant.params.blocks`."""
    schema: dict[str, Any] = {"$schema": DIALECT} | Params.model_json_schema()
    return json.dumps(schema, indent=2) + "\n"


def pipeline() -> str:
    """Return `dvc.yaml` with an output of `digest` for each algorithm but those of imitation."""
    names = [name for name in ALGORITHMS if name not in demonstrated()]
    lines = "".join(f"      - .inputs/train/{name}\n" for name in names)
    content = PIPELINE.read_text(encoding="utf-8")
    return re.sub(r"(      - \.inputs/train/[\w-]+\n)+", lines, content, count=1)


if __name__ == "__main__":
    write_text(PATH, text())
    write_text(PIPELINE, pipeline())
