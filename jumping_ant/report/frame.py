"""The page as HTML: its template, and the charts, library and styles that it embeds.

It opens from disk without a network.
"""

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

FOLDER = Path(__file__).parent
SCRIPTS = ("charts.js", "films.js")


def render(context: Mapping[str, Any], figures: Mapping[str, go.Figure]) -> str:
    """Return the page's HTML, with each chart at its place in the template."""
    plotly, *others = [get_plotlyjs(), *map(_text, SCRIPTS)]
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html").render(
        context,
        charts={name: json.loads(figure.to_json()) for name, figure in figures.items()},
        security_policy=_security_policy(plotly, *others),
        style=_text("style.css"),
        plotly=plotly,
        scripts=others,
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
