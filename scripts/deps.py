"""Write into dvc.yaml which code each stage depends on: all that it imports, directly or not.

Usage: python -m scripts.deps (`make deps`)

A stage that trains, evaluates or films depends on files, so that nothing else reruns it. One that
takes seconds depends on the folders that these files are in. The other dependencies stay as they
are.
"""

from collections.abc import Iterable
from io import StringIO
from pathlib import Path

from ruamel.yaml import YAML

from jumping_ant.base import imports
from jumping_ant.base.files import PROJECT_ROOT, write_text

PATH = PROJECT_ROOT / "dvc.yaml"
QUICK = ("lineup", "compare", "report", "track")
OWN_TRAINER = "jumping_ant/agents/${item.trainer}"
LOCK = "requirements.lock"


def text(before: str) -> str:
    """Return the content of dvc.yaml with the code's current dependencies."""
    yaml = YAML()
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.width = 4096  # does not fold lines
    content = yaml.load(before)
    for name, stage in content["stages"].items():
        deps = stage.get("do", stage)["deps"]
        data = [dep for dep in deps if not dep.startswith(("stages/", "jumping_ant/", LOCK))]
        deps[:] = [*data, *code(name), LOCK]
    buffer = StringIO()
    yaml.dump(content, buffer)
    return buffer.getvalue()


def code(stage: str) -> list[str]:
    """Return the project code that a stage depends on: paths from its root, stages first."""
    script = PROJECT_ROOT / "stages" / f"{stage}.py"
    if stage == "train":
        return _with_any_trainer(script)
    files = imports.closure(script)
    return _names({_folder(file) for file in files} if stage in QUICK else files)


def _with_any_trainer(script: Path) -> list[str]:
    """Return the same for training, which imports the trainer that an agent's block names.

    Of the trainers' packages only the agent's own counts, of other code what any trainer imports.
    """
    trainers = list((PROJECT_ROOT / "jumping_ant" / "agents").glob("*/trainer.py"))
    packages = {trainer.parent for trainer in trainers}
    files = imports.closure(script, *trainers)
    return [OWN_TRAINER, *_names({file for file in files if packages.isdisjoint(file.parents)})]


def _names(paths: Iterable[Path]) -> list[str]:
    names = (str(path.relative_to(PROJECT_ROOT)) for path in paths)
    return sorted(names, key=lambda name: (not name.startswith("stages/"), name))


def _folder(file: Path) -> Path:
    """Return the library's folder that a file is in, or the file itself if it is in none."""
    parts = file.relative_to(PROJECT_ROOT).parts
    return PROJECT_ROOT.joinpath(*parts[:2])


if __name__ == "__main__":
    write_text(PATH, text(PATH.read_text()))
