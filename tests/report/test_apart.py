"""Seconds and the machine change no output of `compare` and `report`."""

import shutil
from functools import partial
from pathlib import Path

import pytest
from small_project import MACHINE, read_csv, write_csv

from jumping_ant.base.files import write_json
from jumping_ant.base.paths import Paths
from jumping_ant.params.model import Params
from jumping_ant.training import scaling
from jumping_ant.training.scaling import Piece
from stages import compare, report, timing

TIMED = ("dqn", "sac", "pgpe")


def outputs(root: Path, params: Params, second: float) -> dict[str, bytes]:
    """Run stages in a project, and return what its folder `results` then holds.

    Without `timing/`; `second` is what a unit of training takes there.
    """
    results = root / "results"
    measured = [
        Piece(name, repeat, threads, 100, second / threads, second)
        for repeat in range(4)
        for name in TIMED
        for threads in (1, 2)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scaling, "measure_all", lambda root, params: measured)
        for stage in (compare, timing, report):
            patch.setattr(stage, "PROJECT_ROOT", root)
            patch.setattr(stage, "Paths", partial(Paths, root))
            patch.setattr(stage, "parse", lambda _: params)
            stage.main()
    files = [path for path in results.rglob("*") if path.is_file()]
    names = {path.relative_to(results).as_posix(): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if "timing/" not in name}


def run_elsewhere(root: Path, params: Params) -> None:
    """Replace every second of training, and the machines, by those of a faster one."""
    for name in params.agents:
        paths = Paths(root).agent(name)
        rows = read_csv(paths.timing)
        write_csv(paths.timing, [row | {"seconds": float(row["seconds"]) / 7} for row in rows])
        write_json(paths.machines, {str(s): MACHINE | {"cpu": "faster"} for s in params.seeds})


def test_equal_results_have_equal_outputs_whatever_the_clock_says(
    project: Path, settings: Params, tmp_path: Path
) -> None:
    shutil.copytree(project, tmp_path, dirs_exist_ok=True)
    here = outputs(tmp_path, settings, 2.0)
    run_elsewhere(tmp_path, settings)
    elsewhere = outputs(tmp_path, settings, 0.5)
    apart = {"scaling.csv", "speed.json"}
    others = {"comparison.json", "robustness.json", "report.html", "figures/final_return.png"}
    assert apart | others <= here.keys()
    assert {name for name in here if here[name] != elsewhere[name]} == apart
