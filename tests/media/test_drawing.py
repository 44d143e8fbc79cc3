"""Drawing: the same pictures from one process and from several, and errors that come through."""

import subprocess
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.media import drawing
from jumping_ant.media.drawing import Shots

SCENE = """
<mujoco>
  <visual><quality shadowsize="256"/><map haze="0.3" zfar="10"/><rgba haze="1 0 0 1"/></visual>
  <asset><texture type="skybox" builtin="flat" rgb1="0 0 1" width="8" height="8"/></asset>
  <worldbody>
    <light pos="0 0 4" dir="0 0 -1" type="directional"/>
    <geom type="plane" size="50 50 50" rgba="0 1 0 1"/>
    <body><joint type="slide" axis="1 0 0"/><geom size="0.3" pos="0 0 1"/></body>
  </worldbody>
</mujoco>
"""
NUM_SHOTS = 7  # no multiple of the numbers of processes below
Started = list[subprocess.Popen[bytes]]


@pytest.fixture(scope="module")
def shots() -> Shots:
    """A ball that slides past the camera, from its left to its right."""
    return Shots(
        model=mujoco.MjModel.from_xml_string(SCENE),
        qpos=np.linspace(-1, 1, NUM_SHOTS)[:, None],
        lookat=np.tile([0.0, 0.0, 1.0], (NUM_SHOTS, 1)),
        width=96,
        height=64,
        distance=4.0,
        azimuth=90.0,
        elevation=-5.0,
    )


@pytest.fixture
def started(shots: Shots, monkeypatch: pytest.MonkeyPatch) -> Started:
    """The processes that draw in a test."""
    list(drawing.draw(shots, 1))  # selects the backend, in processes as well
    processes: Started = []
    start = subprocess.Popen

    def popen(*args: Any, **options: Any) -> subprocess.Popen[bytes]:
        processes.append(start(*args, **options))
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", popen)
    return processes


def pictures(shots: Shots, processes: int) -> NDArray[np.uint8]:
    return np.array(list(drawing.draw(shots, processes)))


def test_pictures_show_the_shots_in_order(shots: Shots) -> None:
    drawn = pictures(shots, 1)
    assert drawn.shape == (NUM_SHOTS, 64, 96, 3)
    balls = drawn.min(axis=-1) > 10  # grey on green and blue
    middles = [np.nonzero(ball)[1].mean() for ball in balls]
    assert (np.diff(middles) > 4).all()
    assert middles[NUM_SHOTS // 2] == pytest.approx(47.5, abs=1)


@pytest.mark.parametrize("processes", [2, 3])
def test_any_number_of_processes_draws_the_same(shots: Shots, processes: int) -> None:
    np.testing.assert_array_equal(pictures(shots, processes), pictures(shots, 1))


def test_few_pictures_start_no_process(
    shots: Shots, started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jumping_ant.base.machine.num_cores", lambda: 8)
    pictures(shots, 0)
    assert len(started) == 0
    monkeypatch.setattr(drawing, "PICTURES_PER_PROCESS", 3)
    pictures(shots, 0)
    assert len(started) == 2


def test_processes_end_with_whom_they_draw_for(shots: Shots, started: Started) -> None:
    drawn = drawing.draw(shots, 2)
    next(drawn)
    assert len(started) == 2
    drawn.close()  # type: ignore[attr-defined]
    assert None not in [process.returncode for process in started]


def test_a_process_that_dies_is_missed(shots: Shots, started: Started) -> None:
    with pytest.raises(InputError, match="a process ended with exit status 1"):
        pictures(replace(shots, qpos=np.zeros((NUM_SHOTS, 5))), 2)
    assert None not in [process.returncode for process in started]
