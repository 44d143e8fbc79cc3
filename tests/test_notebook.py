"""The notebook, cell by cell, on a smaller budget."""

import json
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio

from jumping_ant.base.files import PROJECT_ROOT

PATH = PROJECT_ROOT / "notebooks" / "quickstart.ipynb"
SMALLER = {"18_000": "600", "evaluations=6": "evaluations=2", "in range(200):": "in range(40):"}


def test_it_trains_and_films(tmp_path: Path) -> None:
    cells = json.loads(PATH.read_text(encoding="utf-8"))["cells"]
    drawn = [cell for cell in cells if "needs-jupyter" in cell["metadata"].get("tags", [])]
    code = [cell["source"] for cell in cells if cell["cell_type"] == "code" and cell not in drawn]
    program = "\n".join(map("".join, code))
    for budget, smaller in SMALLER.items():
        assert program.count(budget) == 1
        program = program.replace(budget, smaller)
    command = [sys.executable, "-c", program]
    printed = subprocess.check_output(command, cwd=tmp_path, encoding="utf-8")
    assert printed.count("return of 1,000 steps") == 2
    film = iio.imread(tmp_path / "jump.mp4")
    assert film.shape == (40, 320, 320, 3)
    assert film.std(axis=0).max() > 20, "nothing moves"
