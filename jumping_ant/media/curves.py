"""An agent's learning curves as a drawing, which is visible at any time.

A Rerun plot runs along the selected timeline, and training steps are on a different timeline than
the episode. So the curves are 2-D lines in their own units, under a transform that fits them into
the picture.
"""

from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from jumping_ant.media.scene import TRAIL_COLOR
from jumping_ant.media.states import Array, Color

PATH = "learning/curves"
WIDTH, HEIGHT = 16.0, 5.0  # size of the picture, in the view's units
OTHERS_COLOR: Color = (120, 130, 145)
GRID_COLOR: Color = (62, 68, 78)
LABEL_COLOR: Color = (170, 178, 190)


def log_curves(
    stream: rr.RecordingStream, curves: Mapping[int, tuple[Array, Array]], shown: int
) -> None:
    """Log each seed's learning curve (see `about.Story`); that of the seed `shown` stands out."""
    right = max(max(steps.max(initial=0.0) for steps, _ in curves.values()), 1.0)
    top = max(max(returns.max(initial=0.0) for _, returns in curves.values()), 1.0)
    scale = rr.Transform3D(scale=[WIDTH / right, -HEIGHT / top, 1.0])
    stream.log(PATH, scale, static=True)
    _log_grid(stream, right, top)
    for seed, curve in curves.items():
        path, points = f"{PATH}/seed-{seed}", np.column_stack(curve)
        is_shown = seed == shown
        color, width, order = (TRAIL_COLOR, 1.5, 2.0) if is_shown else (OTHERS_COLOR, 0.75, 1.0)
        thin, thick = rr.Radius.ui_points(width), rr.Radius.ui_points(2 * width)
        lines = rr.LineStrips2D([points], radii=thin, colors=[color], draw_order=order)
        marks = rr.Points2D(points, radii=thick, colors=[color], draw_order=order)
        stream.log(path, lines, static=True)
        stream.log(f"{path}/marks", marks, static=True)


def view() -> rrb.Spatial2DView:
    """Return the view of the curves."""
    bounds = rrb.VisualBounds2D(
        x_range=[-0.09 * WIDTH, 1.05 * WIDTH], y_range=[-1.12 * HEIGHT, 0.22 * HEIGHT]
    )
    name = "Learning: return against control steps, each seed"
    return rrb.Spatial2DView(origin=PATH.partition("/")[0], name=name, visual_bounds=bounds)


def ticks(high: float, most: int = 4) -> Array:
    """Return round numbers from zero up to a value, at most `most` of them besides zero."""
    magnitude = 10.0 ** np.floor(np.log10(high / most))
    step = next(step for step in magnitude * np.array([1, 2, 5, 10]) if high / step <= most)
    return np.arange(0.0, high * (1 + 1e-9), step)


def _log_grid(stream: rr.RecordingStream, right: float, top: float) -> None:
    """Log lines and labels at round numbers of steps and returns."""
    columns = ticks(right) if right > 1 else np.zeros(1)  # an agent may not train at all
    rows = ticks(top)
    lines = [[[x, 0.0], [x, top]] for x in columns] + [[[0.0, y], [right, y]] for y in rows]
    grid = rr.LineStrips2D(
        lines, colors=[GRID_COLOR], radii=rr.Radius.ui_points(0.5), draw_order=0.0
    )
    stream.log(f"{PATH}/grid", grid, static=True)
    labels = rr.Points2D(
        [[x, 0.0] for x in columns] + [[-0.045 * right, y + 0.06 * top] for y in rows],
        labels=[f"{value:,.0f}" for value in (*columns, *rows)],
        colors=[LABEL_COLOR],
        radii=rr.Radius.ui_points(0.0),
        show_labels=True,
    )
    stream.log(f"{PATH}/labels", labels, static=True)
