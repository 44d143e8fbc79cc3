"""Trajectories: saved and loaded, chosen rows, and refusals."""

import dataclasses
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jumping_ant.base.archive import Archive, pack
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_bytes
from jumping_ant.sim import robot, trajectory
from jumping_ant.sim.trajectory import Trajectory


def make(steps: int = 4) -> Trajectory:
    generator = np.random.default_rng(0)
    return Trajectory(
        qpos=generator.normal(size=(steps * 5 + 1, 15)),
        qvel=generator.normal(size=(steps * 5 + 1, 14)),
        torques=generator.uniform(-1, 1, (steps, 8)),
        rewards=generator.uniform(0, 10, steps),
        terms={"alive": np.ones(steps), "upright": generator.uniform(-1, 1, steps)},
        agent="sac-long",
        seed=3,
        episode=7,
        episode_return=12.5,
        timestep=0.01,
        frame_skip=5,
    )


def test_a_saved_trajectory_loads_as_it_was(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a.npz", make().to_bytes())
    loaded, saved = vars(trajectory.load(tmp_path / "a.npz")), vars(make())
    np.testing.assert_equal(loaded, saved)
    assert [*map(type, loaded.values())] == [*map(type, saved.values())]
    terms = {"reward_alive", "reward_upright"}
    with np.load(tmp_path / "a.npz", allow_pickle=False) as content:
        assert content.keys() == saved.keys() - {"terms"} | terms


def test_equal_trajectories_make_equal_bytes() -> None:
    content = make().to_bytes()
    assert content == make().to_bytes() == pack(Archive(content))
    assert content != dataclasses.replace(make(), seed=4).to_bytes()


def changed(content: bytes) -> bytes:
    return content[:500] + bytes([content[500] ^ 0xFF]) + content[501:]


def saved(save: Callable[..., None], *given: Any, **arrays: Any) -> bytes:
    file = BytesIO()
    save(file, *given, **arrays)
    return file.getvalue()


FIELDS = {name: value for name, value in vars(make()).items() if name != "terms"}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "No such file"),
        (b"seed,episode\n0,1\n", "cannot read"),
        *((make().to_bytes()[:length], "a.npz") for length in (0, 3, 200, 2000)),
        (changed(make().to_bytes()), "CRC"),
        (saved(np.savez, qpos=np.zeros((6, 15))), "agent"),
        (saved(np.savez, qpos=np.array([None])), "only pickle could read"),
        (saved(np.save, np.zeros(3)), "cannot read"),
        *(
            (saved(np.savez, **FIELDS | {name: value}), name)
            for name, value in (
                ("qpos", np.zeros((20, 15))),
                ("qvel", np.zeros(21)),
                ("torques", np.zeros(4)),
                ("rewards", np.zeros(5)),
                ("rewards", np.zeros(4, np.int8)),
                ("reward_of_mine", np.zeros(4)),
                ("qpos", np.zeros((21, 0))),
                ("seed", np.float64(30.7)),
                ("seed", np.str_("30")),
                ("frame_skip", np.ones(1, int)),
            )
        ),
    ],
)
def test_damaged_and_foreign_files_are_refused(
    tmp_path: Path, content: bytes | None, words: str
) -> None:
    path = tmp_path / "a.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        trajectory.load(path)


@pytest.mark.parametrize("step", [1e-300, 3e-13, 1e300, 0.0])
def test_a_time_step_that_no_robot_has_is_refused(step: float) -> None:
    with pytest.raises(ValueError, match="simulation steps of"):
        replace(make(), timestep=step)


def test_an_empty_trajectory_is_refused() -> None:
    with pytest.raises(ValueError, match="0 control steps"):
        make(steps=0)


def test_rows_step_by_the_stride_up_to_the_seconds_and_end_where_states_are_not_finite() -> None:
    episode = make()  # 21 states, 0.2 s
    assert episode.rows(stride=2, seconds=0.07).tolist() == [0, 2, 4, 6]
    assert episode.rows(stride=5, seconds=9.0).tolist() == [0, 5, 10, 15, 20]
    episode.qvel[13, 2] = np.nan
    assert episode.rows(stride=4).tolist() == [0, 4, 8, 12]
    episode.qpos[0, 0] = np.inf
    with pytest.raises(InputError, match="nothing to show"):
        episode.rows()


def test_an_episode_of_another_robot_is_refused(robot_xml: str) -> None:
    make().check(robot.load(robot_xml))
    hopper = robot.source_path("hopper").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="given states of 15 positions and 14 velocities and 8 t"):
        make().check(robot.load(hopper))
