"""Which files a file runs."""

from pathlib import Path

import pytest

from jumping_ant.base import imports

FILES = {
    "stage.py": "import json\nfrom house import kitchen\n",
    "house/__init__.py": "",
    "house/kitchen.py": "def cook():\n    from house.cellar.wine import pour\n",
    "house/cellar/__init__.py": "SHELVES = 2\n",
    "house/cellar/wine.py": "import house.garden\n",
    "house/garden.py": "",
    "house/attic.py": "import house.kitchen\n",
    "house/cellar/stairs.py": "from . import wine\nfrom ..kitchen import cook\n",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, content in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    return tmp_path


def names(files: set[Path], root: Path) -> set[str]:
    return {str(file.relative_to(root)) for file in files}


def test_imports_of_the_project_are_found_wherever_they_stand(project: Path) -> None:
    packages = {"house/__init__.py", "house/cellar/__init__.py"}
    cellar = packages | {"house/cellar/wine.py"}
    found = imports.direct(project / "house/kitchen.py", project)
    assert names(found, project) == cellar
    relative = imports.direct(project / "house/cellar/stairs.py", project)
    assert names(relative, project) == {"house/kitchen.py"} | cellar


def test_the_closure_follows_them(project: Path) -> None:
    found = imports.closure(project / "stage.py", root=project)
    house = {"house/__init__.py", "house/kitchen.py", "house/garden.py"}
    cellar = {"house/cellar/__init__.py", "house/cellar/wine.py"}
    assert names(found, project) == {"stage.py"} | house | cellar


def test_no_name_is_no_file_whatever_lies_beside_the_project(project: Path) -> None:
    project.with_suffix(".py").write_text("x = 1\n", encoding="utf-8")
    assert imports.files_of("", project) == set()
