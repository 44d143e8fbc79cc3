"""Axes of figures that fit the values on them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter, NullFormatter

from jumping_ant.words import looks

FAR = 10.0  # ratio of budgets above which their axis is logarithmic


def fit(axes: Axes, values: np.ndarray) -> None:
    """Make the x axis logarithmic if values are far apart, otherwise let it include zero.

    Args:
        axes: The axes.
        values: All values on the axis; NaN where there is none.
    """
    known = values[~np.isnan(values)]
    if looks.is_long(known.tolist()):
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())  # its numbers would overlap
    else:
        anchor_at_zero(axes, known)


def anchor_at_zero(axes: Axes, values: np.ndarray) -> None:
    """End the x axis at zero where all values lie on one side of it."""
    if (values >= 0).all():
        axes.set_xlim(left=0)
    elif (values <= 0).all():
        axes.set_xlim(right=0)


def fit_costs(axes: Axes, costs: Sequence[float]) -> None:
    """Make the x axis logarithmic if costs differ more than tenfold, otherwise let it begin at 0.

    Args:
        axes: The axes.
        costs: All values on the axis, with room for names beside them.
    """
    if max(costs) > FAR * min(costs) > 0:
        axes.set_xscale("log")
        axes.margins(x=0.25)
    else:
        axes.set_xlim(left=0)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.xaxis.set_minor_formatter(NullFormatter())


def fit_time(axes: Axes, times: Sequence[np.ndarray]) -> None:
    """Use a logarithmic x axis if budgets differ more than tenfold, otherwise a linear one.

    Args:
        axes: The axes.
        times: Times of each curve's points, the last of which is its budget.
    """
    lasts = [float(own[-1]) for own in times if own[-1] > 0]
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    if lasts and max(lasts) > FAR * min(lasts):
        axes.set_xscale("log", nonpositive="clip")
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        firsts = [float(own[own > 0][0]) for own in times if (own > 0).any()]
        axes.set_xlim(0.8 * min(firsts), 1.2 * max(lasts))
