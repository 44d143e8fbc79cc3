"""A learner and a metronome under a perturbation, side by side, as a film and as a recording."""

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from jumping_ant.agents import catalogue
from jumping_ant.experiment.models import Params
from jumping_ant.looks import rendering
from jumping_ant.params.blocks import RecordParams
from jumping_ant.recording import about, lineup
from jumping_ant.recording.story import Story
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

FONT = ImageFont.load_default(20)
PLACE = (12, 8)  # [pixels] of a name in its picture

Pictures = Iterator[NDArray[np.uint8]]


def story(params: Params, agent: str, mean_return: float) -> Story:
    """Return what is known about an agent whose episodes returned so much."""
    block = params.agent(agent)
    family = catalogue.row(block).family
    return Story(agent, block.algorithm, family, block.robot, {}, mean_return, {})


def record(
    worlds: Mapping[str, World],
    trajectories: Mapping[str, Trajectory],
    stories: Mapping[str, Story],
    condition: str,
) -> bytes:
    """Return the episodes under a condition, in words, as an `.rrd` file (see `lineup.record`)."""
    describe = partial(about.overtaking_page, condition=condition)
    title = "A learner and a metronome"
    return lineup.record(worlds, trajectories, stories, "overtaking", title, describe)


def film(
    worlds: Mapping[str, World],
    trajectories: Mapping[str, Trajectory],
    stories: Mapping[str, Story],
    params: RecordParams,
) -> bytes:
    """Return the episodes side by side, with their agents' names, as an MP4 file.

    One that ends earlier keeps its last picture.
    """
    films = [
        _named(rendering.frames(worlds[agent].xml, own, params), stories[agent].label)
        for agent, own in trajectories.items()
    ]
    return rendering.encode(_beside(films), params.fps)


def _named(pictures: Pictures, name: str) -> Pictures:
    for picture in pictures:
        drawn = Image.fromarray(picture)
        ImageDraw.Draw(drawn).text(PLACE, name, "white", FONT)
        yield np.asarray(drawn)


def _beside(films: list[Pictures]) -> Pictures:
    last: list[NDArray[np.uint8]] = []
    for pictures in zip_longest(*films):
        before = last or pictures
        last = [old if new is None else new for new, old in zip(pictures, before, strict=True)]
        yield np.concatenate(last, axis=1)
