"""The learners' films side by side: the animated picture of the README."""

import io
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from jumping_ant.agents import catalogue
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file

SIDE = 300  # [pixels] side of an agent's film in the animation
SECONDS = 6.0  # length of the animation
FPS = 20
START = 7.0  # [s] in the films
FONT = ImageFont.load_default(20)


def picture() -> bytes:
    """Return the learners' films side by side, looping, as an animated picture."""
    films = [
        _clip(PROJECT_ROOT / "media" / f"{name}.mp4", catalogue.label(name, agent.algorithm))
        for name, agent in params_file.load().agents.items()
        if not agent.is_baseline
    ]
    first, *others = [Image.fromarray(np.hstack(row)) for row in zip(*films, strict=True)]
    content = io.BytesIO()
    first.save(
        content,
        format="WEBP",
        save_all=True,
        append_images=others,
        duration=round(1000 / FPS),
        loop=0,
        quality=55,
        method=6,
    )
    return content.getvalue()


def _clip(path: Path, label: str) -> list[Image.Image]:
    """Return the pictures of a film that the animation shows, small and labelled."""
    reader: Any = imageio.get_reader(path, format="FFMPEG")  # FFMPEG's type, not the declared one
    with reader:
        fps = reader.get_meta_data()["fps"]
        numbers = [round((START + i / FPS) * fps) for i in range(round(SECONDS * FPS))]
        pictures = [Image.fromarray(reader.get_data(number)) for number in numbers]
    small = [picture.resize((SIDE, SIDE), Image.Resampling.LANCZOS) for picture in pictures]
    for picture in small:
        ImageDraw.Draw(picture).text((12, 8), label, "white", FONT)
    return small
