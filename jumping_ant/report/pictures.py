"""The report's pictures, small enough to embed in the page."""

import base64
import io
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.looks import drawing, rendering
from jumping_ant.looks.drawing import Shots

SIZE = 360  # [pixels] side of a robot's picture
SHADOW_SIZE = 2048  # [pixels] side of its shadow map
CAMERA = {"distance": 3.4, "azimuth": 112.0, "elevation": -20.0}
JPEG_QUALITY = 85


def portrait(xml: str) -> str:
    """Return a picture of a robot as it stands at the start, as a data URI."""
    model = rendering.scene(xml, SHADOW_SIZE)
    data = mujoco.MjData(model)
    lookat = np.array([[0.0, 0.0, 0.6]])
    shots = Shots(model, data.qpos[None], lookat, SIZE, SIZE, **CAMERA)
    return data_uri(next(drawing.draw(shots, processes=1)))


def still(film: Path, seconds: float) -> str:
    """Return a film's frame at a time [s], as a data URI."""
    try:
        reader: Any = imageio.get_reader(film, format="FFMPEG")
        with reader:
            return data_uri(reader.get_data(int(seconds * reader.get_meta_data()["fps"])))
    except (OSError, IndexError) as error:
        reason = str(error).strip().partition("\n")[0]
        raise InputError(f"{film}: {reason}; run `dvc repro --force record@{film.stem}`") from error


def data_uri(picture: NDArray[np.uint8]) -> str:
    """Return a picture, shape (height, width, 3), as the data URI of a JPEG file."""
    content = io.BytesIO()
    imageio.imwrite(content, picture, format="jpg", quality=JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(content.getvalue()).decode()
