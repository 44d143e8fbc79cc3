"""Pictures of a robot's states, in order, rendered by as many processes as pay off.

MuJoCo renders while holding the GIL. Each process is a small program that writes its share to a
pipe: it starts faster than a `multiprocessing` process, which would import the caller's program
too, and blocks until its pictures are read.
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

Picture = NDArray[np.uint8]

PICTURES_PER_PROCESS = 100  # fewer are drawn before another process has started
PIPE_BYTES = 2**20  # Linux's limit for all users; a picture of 480 x 480 takes two thirds
MAX_PROCESSES = 4  # the encoder takes pictures one by one and cannot keep up with more

_PROGRAM = "from jumping_ant.media import drawing; drawing.serve()"
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


def draw(shots: Shots, processes: int = 0) -> Iterator[Picture]:
    """Draw shots as pictures of shape (height, width, 3), which do not depend on `processes`.

    With 1, this process draws; 0 means as many as pay off. Raise `InputError` if this machine
    cannot render.
    """
    useful = min(machine.num_cores(), MAX_PROCESSES, len(shots.qpos) // PICTURES_PER_PROCESS)
    processes = processes or max(1, useful)
    return _draw_here(shots) if processes == 1 else _draw_apart(shots, processes)


def serve() -> None:
    """Draw the shots pickled on standard input; pickled pictures go to standard output.

    If the reader has gone, the work ends silently.
    """
    with contextlib.suppress(BrokenPipeError), os.fdopen(os.dup(1), "wb") as pipe:
        os.dup2(2, 1)  # what libraries print goes to standard error
        for picture in _draw_here(pickle.load(sys.stdin.buffer)):
            pickle.dump(picture, pipe)
            pipe.flush()


def _draw_here(shots: Shots) -> Iterator[Picture]:
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

    MuJoCo draws haze only for infinite planes; the one added here has size zero and is invisible.
    A plane would cast a shadow only on itself, through rounding errors; decoration casts none.
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


def _draw_apart(shots: Shots, processes: int) -> Iterator[Picture]:
    """Distribute the shots over processes, and collect the pictures in order."""
    gl.select_backend()  # once for all of them
    with contextlib.ExitStack() as stack:
        artists = [stack.enter_context(_start()) for _ in range(processes)]
        for number, artist in enumerate(artists):
            stack.callback(artist.kill)
            share = slice(number, None, processes)
            part = replace(shots, qpos=shots.qpos[share], lookat=shots.lookat[share])
            # A process that has died sends no picture.
            with contextlib.suppress(BrokenPipeError), cast(IO[bytes], artist.stdin) as pipe:
                pickle.dump(part, pipe)
        for number in range(len(shots.qpos)):
            artist = artists[number % processes]
            try:
                yield pickle.load(cast(IO[bytes], artist.stdout))
            except (EOFError, pickle.UnpicklingError) as error:
                status = artist.wait()
                raise InputError(
                    f"rendering: a process ended with exit status {status}; see its output above"
                ) from error


def _start() -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | _ENVIRONMENT,
        start_new_session=True,  # Ctrl-C reaches only this process, which ends them
    )
    # With room for a picture in the pipe, the next is drawn before the last is read. Systems
    # without this call, or with a lower limit, only wait longer.
    with contextlib.suppress(AttributeError, OSError):
        fcntl.fcntl(cast(IO[bytes], process.stdout), fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    return process
