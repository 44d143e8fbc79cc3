"""An agent's learning curves as a drawing, which is visible at any time.

A Rerun plot runs along the selected timeline, and training steps are on a different timeline than
the episode. So the curves are 2-D lines in their own units, under a transform that fits them into
the picture.
"""

from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from jumping_ant.recording.parts import Color
from jumping_ant.recording.scene import TRAIL_COLOR

Array = NDArray[np.float64]

PATH = "learning/curves"
WIDTH, HEIGHT = 16.0, 5.0  # size of the picture, in the view's units
OWN_COLOR: Color = TRAIL_COLOR
OTHERS_COLOR: Color = (120, 130, 145)
GRID_COLOR: Color = (62, 68, 78)
LABEL_COLOR: Color = (170, 178, 190)


def log_curves(
    stream: rr.RecordingStream, curves: Mapping[int, tuple[Array, Array]], own_seed: int
) -> None:
    """Log each seed's learning curve (see `story.Story`); that of `own_seed` stands out."""
    right = max(max(steps.max(initial=0.0) for steps, _ in curves.values()), 1.0)
    top = max(max(returns.max(initial=0.0) for _, returns in curves.values()), 1.0)
    scale = rr.Transform3D(scale=[WIDTH / right, -HEIGHT / top, 1.0])
    stream.log(PATH, scale, static=True)
    _log_grid(stream, right, top)
    for seed, (steps, returns) in curves.items():
        _log_curve(stream, seed, np.column_stack([steps, returns]), seed == own_seed)


def view() -> rrb.Spatial2DView:
    """Return the view of the curves."""
    bounds = rrb.VisualBounds2D(
        x_range=[-0.09 * WIDTH, 1.05 * WIDTH], y_range=[-1.12 * HEIGHT, 0.22 * HEIGHT]
    )
    return rrb.Spatial2DView(
        origin=PATH.partition("/")[0],
        name="Learning: return against control steps, each seed",
        visual_bounds=bounds,
    )


def ticks(high: float, most: int = 4) -> Array:
    """Return round numbers from zero up to a value, at most `most` of them besides zero."""
    magnitude = 10.0 ** np.floor(np.log10(high / most))
    step = next(step for step in magnitude * np.array([1, 2, 5, 10]) if high / step <= most)
    return np.arange(0.0, high * (1 + 1e-9), step)


def _log_curve(stream: rr.RecordingStream, seed: int, points: Array, is_own: bool) -> None:
    color, radius = (OWN_COLOR, 1.5) if is_own else (OTHERS_COLOR, 0.75)
    order = 2.0 if is_own else 1.0
    path = f"{PATH}/seed-{seed}"
    lines = rr.LineStrips2D(
        [points], colors=[color], radii=rr.Radius.ui_points(radius), draw_order=order
    )
    stream.log(path, lines, static=True)
    marks = rr.Points2D(
        points, colors=[color], radii=rr.Radius.ui_points(2 * radius), draw_order=order
    )
    stream.log(f"{path}/marks", marks, static=True)


def _log_grid(stream: rr.RecordingStream, right: float, top: float) -> None:
    """Log lines and labels at round numbers of steps and returns."""
    columns = ticks(right) if right > 1 else np.zeros(1)  # an agent may not train at all
    rows = ticks(top)
    lines = [[[x, 0.0], [x, top]] for x in columns] + [[[0.0, y], [right, y]] for y in rows]
    grid = rr.LineStrips2D(
        lines, colors=[GRID_COLOR], radii=rr.Radius.ui_points(0.5), draw_order=0.0
    )
    stream.log(f"{PATH}/grid", grid, static=True)
    places = [[x, 0.0] for x in columns] + [[-0.045 * right, y + 0.06 * top] for y in rows]
    texts = [f"{value:,.0f}" for value in (*columns, *rows)]
    labels = rr.Points2D(
        places,
        labels=texts,
        colors=[LABEL_COLOR],
        radii=rr.Radius.ui_points(0.0),
        show_labels=True,
    )
    stream.log(f"{PATH}/labels", labels, static=True)
