"""The JSON Schema of `params.yaml`, with which editors complete, explain and check it.

Usage: python -m jumping_ant.experiment.schema (`make schema`)
Writes: params.schema.json, which the first line of `params.yaml` points editors to.
"""

import json
from typing import Any

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.experiment.models import Params

PATH = PROJECT_ROOT / "params.schema.json"
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def text() -> str:
    """Return the schema of the models in `jumping_ant.params.blocks`."""
    schema: dict[str, Any] = {"$schema": DIALECT} | Params.model_json_schema()
    return json.dumps(schema, indent=2) + "\n"


if __name__ == "__main__":
    write_text(PATH, text())
