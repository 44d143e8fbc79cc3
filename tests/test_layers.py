"""The library is layered: a room for each stage, and below them shared ground in layers."""

import re
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from jumping_ant.base import imports
from jumping_ant.base.files import PROJECT_ROOT as ROOT

LIBRARY = ROOT / "jumping_ant"
# Shared ground, in the order of the data flow; then the rooms of the stages, side by side.
GROUND = ["base", "compute", "params", "actions", "policies", "sim", "looks", "agents"]
GROUND += ["experiment"]
ROOMS = ["training", "evaluation", "comparison", "recording", "report", "robustness"]
ROOMS += ["play", "tracking", "tuning", "article"]
# A room imports no other, but for the comparison's numbers, what its pages are made of, and tuning,
# which trains and compares.
BESIDE = {("report", "comparison"), ("comparison", "robustness")}
BESIDE |= {("tuning", "training"), ("tuning", "comparison")}
SWITCH = LIBRARY / "__init__.py"  # every import of the library runs it first
MODULES = sorted(path for path in LIBRARY.rglob("*.py") if path.stat().st_size and path != SWITCH)


def place(path: Path) -> str:
    """Return the folder of the library that a file is in, or the module that it is."""
    return path.relative_to(LIBRARY).parts[0].removesuffix(".py")


def test_everything_has_its_place() -> None:
    assert {place(path) for path in MODULES} == {*GROUND, *ROOMS}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(LIBRARY)))
def test_imports_point_one_way(path: Path) -> None:
    here = place(path)
    for imported in imports.direct(path) - {SWITCH}:
        assert imported.is_relative_to(LIBRARY), "the library imports no stage"
        there = place(imported)
        if here in GROUND:
            assert there in GROUND[: GROUND.index(here) + 1]
        else:
            assert there in (*GROUND, here) or (here, there) in BESIDE


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(LIBRARY)))
def test_no_name_is_one_of_the_standard_library(path: Path) -> None:
    names = {Path(part).stem for part in path.relative_to(LIBRARY).parts}
    assert not (names - {"__init__", "__main__"}) & sys.stdlib_module_names


def test_no_modules_import_each_other() -> None:
    TopologicalSorter({path: imports.direct(path) - {SWITCH} for path in MODULES}).prepare()


def test_stages_import_no_stage() -> None:
    for path in (ROOT / "stages").glob("[a-z]*.py"):
        others = {file.name for file in imports.direct(path) if file.parent == path.parent}
        assert others == {"__init__.py"}


def users(library: str) -> set[str]:
    """Return the modules that import a library, as paths from the package's folder."""
    return {
        str(path.relative_to(LIBRARY))
        for path in MODULES
        if re.search(rf"^ *(import|from) {library}\b", path.read_text(encoding="utf-8"), re.M)
    }


def test_mlflow_optuna_and_ray_have_one_home_each() -> None:
    assert {name.split("/")[0] for name in users("optuna")} == {"tuning"}
    assert {name.split("/")[0] for name in users("mlflow")} == {"tracking"}
    assert users("ray") == {"compute/cluster.py"}


def test_package_files_are_empty_but_for_a_switch() -> None:
    filled = {path for path in LIBRARY.rglob("__init__.py") if path.stat().st_size}
    assert filled == {SWITCH, LIBRARY / "tracking" / "__init__.py"}
    assert imports.direct(SWITCH) - {SWITCH} == {LIBRARY / "base" / "portable.py"}
