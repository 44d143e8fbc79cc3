"""The frame of pages, which open from disk without a network.

Charts, their library, styles and pictures are embedded in the file.
"""

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

FOLDER = Path(__file__).parent


def render(
    folder: Path,
    context: Mapping[str, Any],
    charts: Mapping[str, go.Figure],
    scripts: Sequence[str] = ("charts.js",),
) -> str:
    """Return the HTML of a page.

    Args:
        folder: The folder of its `template.html`, which extends `frame.html`.
        context: What the template shows.
        charts: Each chart by its place in the template, which skips missing ones.
        scripts: The files of this folder that the page runs, besides the charts' library.
    """
    plotly, *own = [get_plotlyjs(), *map(_text, scripts)]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([folder, FOLDER]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html").render(
        context,
        charts={name: json.loads(figure.to_json()) for name, figure in charts.items()},
        security_policy=_security_policy(plotly, *own),
        style=_text("style.css"),
        plotly=plotly,
        scripts=own,
    )


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _security_policy(*scripts: str) -> str:
    """Return what browsers may do with the page: run these scripts, and ask nobody for anything."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()) for script in scripts]
    allowed = " ".join(f"'sha256-{digest.decode()}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src 'self' file:; frame-src 'self' file:; base-uri 'none'; "
        "form-action 'none'"
    )
