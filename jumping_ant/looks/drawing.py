"""Pictures of a robot's states, in order, rendered by as many processes as pay off.

MuJoCo renders while holding the GIL, and a software renderer gains little from its own threads, so
the pictures are distributed over processes. Each is a small program that writes its share to a
pipe. It starts faster than a `multiprocessing` process, which would import the caller's program
too, and it blocks until its pictures are read, so few of them are in memory.
"""

import contextlib
import fcntl
import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import IO, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base import machine
from jumping_ant.base.errors import InputError
from jumping_ant.sim import gl

Process = subprocess.Popen[bytes]

PICTURES_PER_PROCESS = 100  # fewer are drawn before another process has started
PIPE_BYTES = 2**20  # Linux's limit for all users; a picture of 480 x 480 takes two thirds
MAX_PROCESSES = 4  # the encoder takes pictures one by one and cannot keep up with more

_PROGRAM = "from jumping_ant.looks import drawing; drawing.serve()"
# Each process fills a core, so llvmpipe, Mesa's software renderer, needs no extra threads.
_ENVIRONMENT = {"LP_NUM_THREADS": "0"}


@dataclass(frozen=True, eq=False)
class Shots:
    """What to draw: n states, seen by a camera."""

    model: mujoco.MjModel
    qpos: NDArray[np.float64]  # positions in each state, (n, model.nq)
    lookat: NDArray[np.float64]  # points that the camera looks at [m], (n, 3)
    width: int  # of a picture [pixels]
    height: int  # [pixels]
    distance: float  # of the camera from its point [m]
    azimuth: float  # of the camera's view [degrees]
    elevation: float  # [degrees]

    def every(self, step: int, start: int) -> "Shots":
        """Return every `step`-th shot, beginning with number `start`."""
        return replace(self, qpos=self.qpos[start::step], lookat=self.lookat[start::step])


def draw(shots: Shots, processes: int = 0) -> Iterator[NDArray[np.uint8]]:
    """Draw shots as pictures of shape (height, width, 3), which do not depend on `processes`.

    With 1, this process draws; 0 means as many as pay off. Raises `InputError` if this machine
    cannot render.
    """
    processes = processes or _num_worthwhile(len(shots.qpos))
    return _draw_here(shots) if processes == 1 else _draw_apart(shots, processes)


def serve() -> None:
    """Draw the shots that arrive pickled on standard input, for `_draw_apart`.

    Pickled pictures go to standard output, followed by the error that ended the work, if any.
    If the reader has gone, the work ends silently.
    """
    with contextlib.suppress(BrokenPipeError), os.fdopen(os.dup(1), "wb") as pipe:
        os.dup2(2, 1)  # what libraries print goes to standard error
        try:
            for picture in _draw_here(pickle.load(sys.stdin.buffer)):
                pickle.dump(picture, pipe)
                pipe.flush()
        except InputError as error:
            pickle.dump(error, pipe)


def _num_worthwhile(num_pictures: int) -> int:
    useful = min(machine.num_cores(), MAX_PROCESSES)
    return max(1, min(useful, num_pictures // PICTURES_PER_PROCESS))


def _draw_here(shots: Shots) -> Iterator[NDArray[np.uint8]]:
    data = mujoco.MjData(shots.model)
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth = shots.distance, shots.azimuth
    camera.elevation = shots.elevation
    with gl.open_renderer(shots.model, shots.width, shots.height) as renderer:
        for qpos, lookat in zip(shots.qpos, shots.lookat, strict=True):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(shots.model, data)
            mujoco.mj_camlight(shots.model, data)
            camera.lookat[:] = lookat
            renderer.update_scene(data, camera)
            _finish(renderer.scene)
            yield renderer.render()


def _finish(scene: mujoco.MjvScene) -> None:
    """Lay haze over the horizon of the ground z = 0, and let planes cast no shadow.

    MuJoCo draws haze only for infinite planes; the one added here has size zero and is itself
    invisible. Decoration casts no shadows. The shadow of a plane would fall only on the plane
    itself, through rounding errors.
    """
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_PLANE,
        size=np.zeros(3),
        pos=np.zeros(3),
        mat=np.eye(3).ravel(),
        rgba=np.ones(4, dtype=np.float32),
    )
    scene.ngeom += 1
    for geom in scene.geoms[: scene.ngeom]:
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR


def _draw_apart(shots: Shots, processes: int) -> Iterator[NDArray[np.uint8]]:
    """Distribute the shots over processes, and collect the pictures in order."""
    gl.select_backend()  # once for all of them
    with contextlib.ExitStack() as stack:
        artists = [stack.enter_context(_start()) for _ in range(processes)]
        for number, artist in enumerate(artists):
            _send(artist, shots.every(processes, number))
        for number in range(len(shots.qpos)):
            yield _receive(artists[number % processes])


@contextlib.contextmanager
def _start() -> Iterator[Process]:
    command = [sys.executable, "-c", _PROGRAM]
    environment = os.environ | _ENVIRONMENT
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command,
        stdin=pipe,
        stdout=pipe,
        env=environment,
        start_new_session=True,  # Ctrl-C reaches only this process, which ends them
    ) as process:
        # With room for a picture in the pipe, the next is drawn before the last is read. Systems
        # without this call, or with a lower limit, only wait longer.
        with contextlib.suppress(AttributeError, OSError):
            fcntl.fcntl(cast(IO[bytes], process.stdout), fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def _send(process: Process, shots: Shots) -> None:
    # `_receive` detects a process that has died.
    with contextlib.suppress(BrokenPipeError), cast(IO[bytes], process.stdin) as pipe:
        pickle.dump(shots, pipe)


def _receive(process: Process) -> NDArray[np.uint8]:
    try:
        item = pickle.load(cast(IO[bytes], process.stdout))
    except (EOFError, pickle.UnpicklingError) as error:
        raise RuntimeError(
            f"a rendering process ended early, with exit status {process.wait()}; see its output "
            "above"
        ) from error
    if isinstance(item, InputError):
        raise item
    picture: NDArray[np.uint8] = item
    return picture
