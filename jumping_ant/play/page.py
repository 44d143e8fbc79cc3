"""The live page: MuJoCo, robots and policies in one file, which asks nobody for anything."""

import base64
import hashlib
import json
from importlib.metadata import distribution, version
from pathlib import Path

import jinja2
import pyarrow as pa

from jumping_ant.params.model import Params
from jumping_ant.play import content, vendor

FOLDER = Path(__file__).parent
LICENCE = "licenses/LICENSE"


def path(root: Path) -> Path:
    """Return the place of a project's page."""
    return root / "results" / "play.html"


def build(root: Path, params: Params) -> str:
    """Return the page's HTML, from the project's robots, policies and results.

    Raises:
        InputError: The page's libraries are not there.
    """
    included = content.all_policies(root, params)
    known = content.build(root, params, included)
    parts = vendor.files()
    licence = parts.pop("LICENSE").decode()
    for (agent, seed), policy in included.items():
        parts[f"{agent}/{seed}"] = json.dumps(policy).encode()
    sources = (FOLDER / "play.css", *sorted(FOLDER.glob("[!.]*.js")))
    texts = {file.name: file.read_text(encoding="utf-8") for file in sources}
    style, boot = texts.pop("play.css"), texts.pop("boot.js")  # which unpacks all other modules
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("play.html").render(
        name=known["name"],
        security_policy=_security_policy(boot),
        style=style,
        num_commands=len(known["task"]["commands"]),
        native=version("mujoco"),
        ported=vendor.PACKAGES[0].version,
        apache=distribution("mujoco").read_text(LICENCE),
        mit=licence,
        packed=[(name, _pack(part)) for name, part in parts.items()],
        modules=list(texts.items()),
        content=known,
        boot=boot,
    )


def _pack(data: bytes) -> str:
    """Return compressed bytes as text, the same everywhere: Python's zlib is the system's."""
    compressed = pa.Codec("gzip", compression_level=9).compress(data, asbytes=True)
    return base64.b64encode(compressed).decode()


def _security_policy(boot: str) -> str:
    """Return what browsers may do with the page: run what is in it, and ask no other servers.

    MuJoCo's bindings make functions from text.
    """
    digest = base64.b64encode(hashlib.sha256(boot.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}' blob: 'unsafe-eval'; worker-src blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; connect-src 'none'; "
        "base-uri 'none'; form-action 'none'"
    )
