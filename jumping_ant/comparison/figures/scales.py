"""Axes of figures that fit the values on them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter, NullFormatter

from jumping_ant.comparison import charting


def fit(axes: Axes, values: np.ndarray) -> None:
    """Make the x axis logarithmic if values are far apart, otherwise let it include zero."""
    known = values[~np.isnan(values)]
    if charting.is_long(known.tolist()):
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
    """Fit the x axis to costs, with room for names beside them on a logarithmic one."""
    fit(axes, np.array(costs))
    if axes.get_xscale() == "log":
        axes.margins(x=0.25)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))


def fit_time(axes: Axes, times: Sequence[np.ndarray]) -> None:
    """Make the x axis logarithmic if budgets, the last of each curve's times, are far apart."""
    ends = charting.log_ends(times)
    if ends:
        axes.set_xscale("log", nonpositive="clip")
        axes.set_xlim(ends)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
