"""Short episodes, and recordings read back."""

from collections import defaultdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.media.about import Story
from jumping_ant.sim.trajectory import Trajectory


def simulate(
    model: mujoco.MjModel,
    ctrl: NDArray[np.float64],
    height: float = 0.75,
    upward_speed: float = 0.0,
) -> Trajectory:
    """Let the robot go from a height [m] at a speed [m/s] while `ctrl` drives its motors."""
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[2] = height, upward_speed
    qpos, qvel = [data.qpos.copy()], [data.qvel.copy()]
    for torques in ctrl:
        data.ctrl[:] = torques
        for _ in range(5):
            mujoco.mj_step(model, data)
            qpos.append(data.qpos.copy())
            qvel.append(data.qvel.copy())
    rewards = np.arange(len(ctrl), dtype=np.float64) / 7
    return Trajectory(
        qpos=np.array(qpos),
        qvel=np.array(qvel),
        torques=ctrl,
        rewards=rewards,
        terms={"torso_height": rewards},
        agent="sac",
        seed=4,
        episode=11,
        episode_return=1.0,
        timestep=0.01,
        frame_skip=5,
    )


def story(
    agent: str = "sac", algorithm: str = "sac", value: float = 1234.5, robot: str = "edited"
) -> Story:
    """The story of an episode with such a return."""
    measures = {"return": value, "peak_height": 2.5, "jumps": 12.0, "airborne_seconds": 1.25}
    family = ALGORITHMS[algorithm].family
    return Story(agent, algorithm, family, robot, measures, mean_return=value / 2)


class Content:
    """The chunks of a recording, by entity."""

    def __init__(self, path: Path) -> None:
        self.moving: dict[str, list[Chunk]] = defaultdict(list)
        self.still: dict[str, list[Chunk]] = defaultdict(list)
        for chunk in RrdReader(path).stream():
            (self.still if chunk.is_static else self.moving)[chunk.entity_path].append(chunk)

    def column(self, entity: str, component: str) -> NDArray[Any]:
        """The values of a component over time, one a row."""
        values = self.lists(entity, component)
        assert all(len(value) == 1 for value in values)
        return np.array([value[0] for value in values])

    def lists(self, entity: str, component: str) -> list[Any]:
        """The values of a component over time, any number a row."""
        return self._batch(entity, component).column(component).to_pylist()

    def _batch(self, entity: str, column: str) -> pa.RecordBatch:
        batches = [chunk.to_record_batch() for chunk in self.moving[entity]]
        (batch,) = (batch for batch in batches if column in batch.schema.names)
        return batch

    def scalars(self, entity: str) -> NDArray[Any]:
        return self.column(entity, "Scalars:scalars")

    def times(self, entity: str) -> NDArray[np.int64]:
        """Times in nanoseconds."""
        return self._batch(entity, "sim_time").column("sim_time").cast("int64").to_numpy()

    def steps(self, entity: str) -> list[int]:
        return self.lists(entity, "control_step")

    def shape(self, entity: str) -> dict[str, NDArray[np.float64]]:
        """The components of a static entity."""
        values: dict[str, NDArray[np.float64]] = {}
        for chunk in self.still[entity]:
            batch = chunk.to_record_batch()
            for name in batch.schema.names[1:]:
                values[name.split(":")[1]] = np.array(batch.column(name).to_pylist()[0][0])
        return values
