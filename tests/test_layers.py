"""The library is layered: shared ground in the order of the data flow, above it rooms side by side.

Checked here rather than by import-linter: it has no contract for who may import a library.
"""

import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from jumping_ant.base import imports
from jumping_ant.base.files import PROJECT_ROOT as ROOT

LIBRARY = ROOT / "jumping_ant"
SWITCH = LIBRARY / "__init__.py"  # every import of the library runs it first
GROUND = ["base", "compute", "params.blocks", "params.article", "policies", "sim", "agents"]
GROUND += ["params", "training", "evaluation", "media", "comparison", "report"]
ROOMS = ["play", "tracking", "tuning", "article"]
COMMAND = "__main__"  # runs what it is asked for, and nothing imports it
BESIDE = {("tracking", "tuning")}  # a study's trials
HOMES = {"mlflow": {"tracking"}, "optuna": {"tuning"}, "ray": {"compute"}}
FILES = {path for path in LIBRARY.rglob("*.py") if path.stat().st_size and path != SWITCH}
IMPORTS = {path: imports.direct(path) & FILES for path in FILES}


def place(path: Path) -> str:
    """Return the room that a file is in."""
    parts = path.relative_to(LIBRARY).with_suffix("").parts
    if path.name == "__main__.py":
        return COMMAND
    return module if (module := ".".join(parts)) in GROUND else parts[0]


@pytest.mark.parametrize("path", sorted(FILES), ids=lambda path: str(path.relative_to(LIBRARY)))
def test_imports_point_one_way(path: Path) -> None:
    here = place(path)
    assert here in (*GROUND, *ROOMS, COMMAND)
    above = [*GROUND, *(ROOMS if here == COMMAND else [here])]
    below = GROUND[: GROUND.index(here) + 1] if here in GROUND else above
    assert all(it.is_relative_to(LIBRARY) for it in imports.direct(path)), "it imports no stage"
    for imported in IMPORTS[path]:
        assert place(imported) in below or (here, place(imported)) in BESIDE
    libraries = {name.partition(".")[0] for name in imports.modules(path)}
    assert all(here in HOMES[library] for library in libraries & HOMES.keys())


def test_no_modules_import_each_other() -> None:
    TopologicalSorter(IMPORTS).prepare()


def test_stages_import_no_stage() -> None:
    for path in (ROOT / "stages").glob("[a-z]*.py"):
        others = {file.name for file in imports.direct(path) if file.parent == path.parent}
        assert others == {"__init__.py"}


def test_no_module_is_named_as_one_of_the_standard_library() -> None:
    names = {Path(part).stem for path in FILES for part in path.relative_to(LIBRARY).parts}
    assert not (names - {"__init__", "__main__"}) & sys.stdlib_module_names


def test_package_files_are_empty_but_for_a_switch() -> None:
    filled = {path for path in FILES if path.name == "__init__.py"}
    assert filled == {LIBRARY / "tracking" / "__init__.py"}
    assert imports.direct(SWITCH) & FILES == {LIBRARY / "base" / "portable.py"}
