"""Videos of recorded episodes, rendered off screen and encoded to the same bytes in every run."""

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import imageio.v2 as imageio
import imageio_ffmpeg  # type: ignore[import-untyped]
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from jumping_ant.base.errors import InputError
from jumping_ant.media import drawing
from jumping_ant.media.drawing import Picture, Shots
from jumping_ant.params.blocks import RecordParams
from jumping_ant.sim import mjcf
from jumping_ant.sim.anatomy import Anatomy
from jumping_ant.sim.trajectory import Trajectory, frame_stride


class View(NamedTuple):
    """From where films show a robot."""

    distance: float = 6.0  # [m] from the torso; for robots of the Ant's size
    azimuth: float = 135.0  # [degrees]
    elevation: float = -12.0  # [degrees] negative looks down
    shadow_size: int = 512  # [pixels] side of the shadow map; 0 draws none


VIEW = View()

# The camera follows the torso's path, smoothed over this long [s].
CAMERA_SMOOTHING = 0.25
# As fractions of the camera's distance: the height it looks at, and how far above that the torso
# rises before the camera rises too. Below, ground and horizon stay still, so jumps are visible.
CAMERA_HEIGHT = 0.22
CAMERA_SLACK = 0.2

# Corners of round parts: around, and from pole to pole. In films, MuJoCo's 28 and 16 look the same.
SLICES, STACKS = 16, 10
LIGHT_HEIGHT = 8.0  # [m] height of the lamp above the torso
SHADOW_REACH = 2.0  # [m] largest distance of a shadow from the point below the torso
TILE = 2.0  # [m] side of the floor's squares
# [m] from the origin to the edge of the floor, farther than episodes go: MuJoCo draws an infinite
# floor slowly. The number of tiles is odd, which puts corners of tiles at the origin.
FLOOR_REACH = 501 * TILE
DARK_TILE = (0.30, 0.37, 0.45)
LIGHT_TILE = (0.36, 0.44, 0.53)
TILE_EDGE = (0.62, 0.70, 0.78)
ZENITH = (0.45, 0.62, 0.80)
HORIZON = (0.80, 0.87, 0.94)


def film(xml: str, trajectory: Trajectory, params: RecordParams, processes: int = 0) -> bytes:
    """Return an episode's first seconds as an MP4 file (see `frames` and `encode`)."""
    return encode(frames(xml, trajectory, params, processes), params.fps)


def frames(
    xml: str, trajectory: Trajectory, params: RecordParams, processes: int = 0, view: View = VIEW
) -> Iterator[NDArray[np.uint8]]:
    """Draw an episode's first seconds on demand, as pictures of shape (height, width, 3)."""
    model = scene(xml, view.shadow_size)
    trajectory.check(model)
    rows = trajectory.rows(frame_stride(trajectory.timestep, params.fps), params.seconds)
    shots = Shots(
        model=model,
        qpos=trajectory.qpos[rows],
        lookat=camera_path(Anatomy.of(model).places(trajectory.qpos[rows]), params.fps, view),
        width=params.width,
        height=params.height,
        distance=view.distance,
        azimuth=view.azimuth,
        elevation=view.elevation,
    )
    return drawing.draw(shots, processes)


def camera_path(torso: NDArray[np.float64], fps: int, view: View = VIEW) -> NDArray[np.float64]:
    """Return the points that the camera looks at [m], (num_frames, 3): the torso's path, smoothed.

    Their height is constant until the torso would leave the picture.
    """
    height, slack = CAMERA_HEIGHT * view.distance, CAMERA_SLACK * view.distance
    points = torso.copy()
    points[:, 2] = np.maximum(height, torso[:, 2] - slack)
    smoothing = CAMERA_SMOOTHING * fps
    smooth: NDArray[np.float64] = gaussian_filter1d(points, smoothing, axis=0, mode="nearest")
    return smooth


def scene(xml: str, shadow_size: int) -> mujoco.MjModel:
    """Compile a robot for rendering: a tiled floor to the horizon, a sky, and an overhead lamp.

    Only the looks change. The source's lamp hangs at 1.3 m, lower than a jump. `shadow_size` is the
    side of the shadow map [pixels]; 0 draws no shadow.
    """
    spec = mjcf.parse(xml)
    planes = [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
    if not planes:
        raise InputError("robot XML: given no floor, allowed: a plane in the world")
    torso = Anatomy.of(mjcf.compiled(spec)).torso
    _paint(spec, planes[0])
    _light(spec, next(body for body in spec.bodies if body.id == torso))
    spec.stat.extent = 4.0  # [m] unit of the distances below; by default MuJoCo's estimate
    spec.visual.map.zfar = 20.0
    spec.visual.map.shadowclip = SHADOW_REACH / spec.stat.extent
    spec.visual.quality.shadowsize = shadow_size
    spec.visual.quality.numslices, spec.visual.quality.numstacks = SLICES, STACKS
    spec.visual.quality.offsamples = 0  # smoother edges would double the time of a frame
    return spec.compile()


def encode(pictures: Iterable[Picture], fps: int) -> bytes:
    """Encode pictures as an MP4 file that every browser plays: H.264, yuv420p, index first.

    Equal pictures, (height, width, 3) with even sides, make equal bytes: one encoder thread, no
    dates, no versions. Raise `OSError` if the encoder fails, as on a full disk.
    """
    options = (
        "-crf 19 -preset veryfast -threads 1 "
        "-vf scale=out_color_matrix=bt709:out_range=tv,"
        "setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709 "
        "-fflags +bitexact -flags:v +bitexact -map_metadata -1 -movflags +faststart"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        writer: Any = imageio.get_writer(
            path,
            format="FFMPEG",
            fps=fps,
            codec="libx264",
            pixelformat="yuv420p",
            quality=None,
            macro_block_size=1,  # sizes stay as given: even ones fit yuv420p
            output_params=options.split(),
            ffmpeg_log_level="quiet",  # after Ctrl-C it may live on, and miss its file
        )
        num_pictures, num_frames = 0, 0
        with writer:
            for picture in pictures:
                writer.append_data(picture)
                num_pictures += 1
        with suppress(RuntimeError):  # the encoder's exit status is lost
            num_frames, _ = imageio_ffmpeg.count_frames_and_secs(path)
        if num_frames != num_pictures:
            message = f"ffmpeg encoded {num_frames} of {num_pictures} frames; is the disk full?"
            raise OSError(message)
        return path.read_bytes()


def _paint(spec: mujoco.MjSpec, floor: mujoco.MjsGeom) -> None:
    """Give the scene a tiled floor to the horizon, and a sky that meets it in haze."""
    spec.add_texture(
        name="tiles",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=DARK_TILE,
        rgb2=LIGHT_TILE,
        markrgb=TILE_EDGE,
        width=256,
        height=256,
    )
    tiles = spec.add_material(
        name="tiles",
        texuniform=True,
        texrepeat=[1.0 / TILE] * 2,  # of half the texture, which is two tiles wide
        specular=0.1,
        shininess=0.1,
        reflectance=0.0,
    )
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    floor.material = "tiles"
    floor.rgba = [1.0] * 4
    floor.size = [FLOOR_REACH] * 3  # in four pieces: the last entry is the side of each
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1, texture.rgb2 = ZENITH, HORIZON
    spec.visual.rgba.haze = [*HORIZON, 1.0]


def _light(spec: mujoco.MjSpec, torso: mujoco.MjsBody) -> None:
    """Hang one lamp straight above the torso, so that the shadow shows where it is."""
    for light in spec.lights:
        spec.delete(light)
    torso.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        pos=[0.0, 0.0, LIGHT_HEIGHT],
        dir=[0.0, 0.0, -1.0],
        ambient=[0.0] * 3,
        diffuse=[0.75] * 3,
        specular=[0.3] * 3,
    )
    spec.visual.headlight.ambient = [0.38] * 3
    spec.visual.headlight.diffuse = [0.38] * 3
    spec.visual.headlight.specular = [0.1] * 3
