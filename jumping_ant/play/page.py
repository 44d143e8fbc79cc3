"""The live page: MuJoCo, robots and policies in one file, which asks nobody for anything."""

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

import jinja2
import pyarrow as pa

from jumping_ant.params.model import Params
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
    included = content.all_policies(root, params)
    policies = {
        f"{agent}/{seed}": json.dumps(policy).encode() for (agent, seed), policy in included.items()
    }
    seeds: dict[str, list[int]] = {}
    for agent, seed in included:
        seeds.setdefault(agent, []).append(seed)
    return render(content.build(root, params, seeds), vendor.files() | policies)


def render(known: Mapping[str, Any], parts: Mapping[str, bytes]) -> str:
    """Return the HTML of a page.

    Args:
        known: What it knows (`jumping_ant.play.content`).
        parts: What it holds compressed, by name: libraries and policies.
    """
    boot = (FOLDER / BOOT).read_text(encoding="utf-8")
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
        style=(FOLDER / "play.css").read_text(encoding="utf-8"),
        num_commands=len(known["task"]["commands"]),
        native=version("mujoco"),
        ported=vendor.PACKAGES[0].version,
        apache=distribution("mujoco").read_text(LICENCE),
        mit=parts["LICENSE"].decode(),
        packed=[(name, _pack(part)) for name, part in parts.items() if name != "LICENSE"],
        modules=list(_modules()),
        content=known,
        boot=boot,
    )


def _pack(data: bytes) -> str:
    """Return compressed bytes as text, the same everywhere: Python's zlib is the system's."""
    compressed = pa.Codec("gzip", compression_level=9).compress(data, asbytes=True)
    return base64.b64encode(compressed).decode()


def _modules() -> Iterator[tuple[str, str]]:
    for file in sorted(FOLDER.glob("*.js")):
        if file.name != BOOT and not file.name.startswith("."):
            yield file.name, file.read_text(encoding="utf-8")


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
