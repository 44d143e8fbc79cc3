"""The notebook, cell by cell, on a smaller budget."""

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio

from jumping_ant.base.files import PROJECT_ROOT

PATH = PROJECT_ROOT / "notebooks" / "quickstart.ipynb"
SMALLER = {
    "18_000": "600",
    "evaluations=6": "evaluations=2",
    "for step in range(200)": "for step in range(40)",
}


def cells() -> list[str]:
    """Return the code, but for cells that draw in Jupyter's page."""
    return [
        "".join(cell["source"])
        for cell in json.loads(PATH.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code" and "needs-jupyter" not in cell["metadata"].get("tags", [])
    ]


def test_it_trains_and_films(tmp_path: Path) -> None:
    program = "\n".join(cells())
    for budget, smaller in SMALLER.items():
        assert program.count(budget) == 1
        program = program.replace(budget, smaller)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        encoding="utf-8",
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("return of 1,000 steps") == 2
    film = iio.imread(tmp_path / "jump.mp4")
    assert film.shape == (40, 320, 320, 3)
    assert film.std(axis=0).max() > 20, "nothing moves"
