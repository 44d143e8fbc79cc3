"""The live page: MuJoCo, robots and policies in one file, which asks nobody for anything."""

import base64
import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import distribution, version
from pathlib import Path

import jinja2
import pyarrow as pa

from jumping_ant.experiment.models import Params
from jumping_ant.play import content, vendor

FOLDER = Path(__file__).parent
BOOT = "boot.js"  # runs by itself; all other modules are unpacked by it
LICENCE = "licenses/LICENSE"


def path(root: Path) -> Path:
    """Return the place of a project's page."""
    return root / "results" / "play.html"


def build(root: Path, params: Params) -> str:
    """Return the page's HTML, from the project's robots, policies and results.

    Raises:
        InputError: The page's libraries are not there.
    """
    libraries = vendor.files()
    policies = content.all_policies(root, params)
    boot = (FOLDER / BOOT).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    licence = distribution("mujoco").read_text(LICENCE)
    own = content.build(root, params, policies)
    return environment.get_template("play.html").render(
        name=own["name"],
        security_policy=_security_policy(boot),
        style=(FOLDER / "play.css").read_text(encoding="utf-8"),
        num_commands=len(params.env.commands),
        native=version("mujoco"),
        ported=vendor.PACKAGES[0].version,
        apache=licence,
        mit=libraries.pop("LICENSE").decode(),
        packed=list(_packed(libraries, policies)),
        modules=list(_modules()),
        content=own,
        boot=boot,
    )


def _packed(libraries: dict[str, bytes], policies: content.Policies) -> Iterator[tuple[str, str]]:
    """Yield the names of compressed parts, and what they hold."""
    for name, library in libraries.items():
        yield name, _pack(library)
    for (agent, seed), policy in policies.items():
        yield f"{agent}/{seed}", _pack(json.dumps(policy).encode())


def _pack(data: bytes) -> str:
    """Return compressed bytes as text, the same everywhere: Python's zlib is the system's."""
    compressed = pa.Codec("gzip", compression_level=9).compress(data, asbytes=True)
    return base64.b64encode(compressed).decode()


def _modules() -> Iterator[tuple[str, str]]:
    for file in sorted(FOLDER.glob("*.js")):
        if file.name != BOOT and not file.name.startswith("."):
            yield file.name, file.read_text(encoding="utf-8")


def _security_policy(boot: str) -> str:
    """Return what browsers may do with the page: run what is in it, and ask nobody for anything.

    MuJoCo's bindings make functions from text.
    """
    digest = base64.b64encode(hashlib.sha256(boot.encode()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{digest}' blob: 'unsafe-eval'; worker-src blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
