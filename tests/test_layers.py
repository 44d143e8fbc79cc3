"""The library is layered: a module imports only from layers above its own."""

import pytest

from jumping_ant import imports
from jumping_ant.files import PROJECT_ROOT as ROOT


def top(path) -> str:
    """Return the module or package of `jumping_ant` that a file belongs to."""
    return path.relative_to(ROOT / "jumping_ant").parts[0].removesuffix(".py")


LAYERS = [
    {"errors"},
    {"archive", "events", "files", "gl", "looks", "machine", "measures", "motion", "seeding"}
    | {"tables", "wording"},
    {"imports", "params"},
    {"article", "drawing", "params_file", "rewards", "robot", "schema", "statistics", "task"}
    | {"trajectory"},
    {"hypothesis_tests", "vector", "rendering", "recording"},
    {"env", "policies", "sample_sizes"},
    {"agents", "playing", "presets", "rollout", "serving"},
    {"checkpoints", "compute", "evaluation", "progress", "reproduction", "results", "variants"},
    {"claim_panels", "comparison"},
    {"claims", "figures", "report", "scaling", "tracking", "training", "watch"},
    {"article_figures"},
]
LAYER = {name: number for number, names in enumerate(LAYERS) for name in names}
MODULES = sorted((ROOT / "jumping_ant").rglob("*.py"))


@pytest.mark.parametrize("path", [path for path in MODULES if path.stat().st_size], ids=top)
def test_imports_point_upwards(path) -> None:
    for imported in imports.direct(path):
        assert imported.is_relative_to(ROOT / "jumping_ant"), "the library imports no stage"
        if top(imported) != top(path):
            assert LAYER[top(imported)] < LAYER[top(path)], f"{path.name} imports {imported.name}"


def test_mlflow_and_ray_have_one_home_each() -> None:
    for library, homes in (("mlflow", {"tracking", "serving"}), ("ray", {"compute"})):
        users = {
            top(path)
            for path in MODULES
            if f"import {library}" in path.read_text() or f"from {library}" in path.read_text()
        }
        assert users == homes


def test_package_files_are_empty() -> None:
    assert all(path.stat().st_size == 0 for path in MODULES if path.name == "__init__.py")
