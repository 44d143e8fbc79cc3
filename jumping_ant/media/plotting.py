"""The style of matplotlib's figures, and their files: equal figures give equal bytes."""

import io
from typing import Any, Literal

from matplotlib import style
from matplotlib.figure import Figure

from jumping_ant.media.style import INK

STYLE: Any = {  # matplotlib types it by each key's name
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E5E5E5",
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "savefig.dpi": 150,
    "svg.hashsalt": "jumping-ant",  # the SVG's element names are random without it
}
STYLES = ["default", STYLE]  # whatever the reader's matplotlibrc says


def entitle(figure: Figure, title: str) -> Figure:
    """Give a figure a title at its left edge, and return it."""
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def render(figure: Figure, kind: Literal["png", "svg"]) -> bytes:
    """Return a figure as a file's content, without dates and versions."""
    content = io.BytesIO()
    metadata = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}[kind]
    with style.context(STYLES):
        figure.savefig(content, format=kind, metadata=metadata)
    return content.getvalue()
