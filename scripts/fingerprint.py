"""Compute a digest of every layer that results rest on, and compare it with the published one.

Usage: python -m scripts.fingerprint [--publish]

Where two machines give different results, the first layer that differs is the cause. The published
digests are in results/fingerprint.json, with the processors that were compared. `--publish` adds
this one, there and in docs/tables.md. It starts both anew with other versions than the
published ones, or if a published processor computes something else than before: then the project
has changed.
"""

import importlib.metadata
import platform
import sys
import time
import warnings
from collections.abc import Mapping
from typing import Any

from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, read_json, write_json
from scripts import layers, publish

PATH = PROJECT_ROOT / "results" / "fingerprint.json"
PACKAGES = (*machine.PACKAGES, "matplotlib", "pillow", "scipy")
EQUAL = "equal"
RENDERER = "renderer"  # of OpenGL, on which films rest alone


def versions() -> dict[str, str]:
    """Return the versions that the digests hold for."""
    system = {"libc": " ".join(platform.libc_ver()), RENDERER: layers.renderer()}
    return system | {name: importlib.metadata.version(name) for name in PACKAGES}


def published() -> dict[str, Any]:
    """Return the content of `results/fingerprint.json`."""
    return read_json(PATH, "")


def compare(known: Mapping[str, Any]) -> tuple[dict[str, str], list[str]]:
    """Compute and print every layer; return the digests, and which differ from the published."""
    ours, different = {}, []
    started = time.perf_counter()
    for name, parts in layers.layers():
        with warnings.catch_warnings(action="ignore"):  # of libraries, about themselves
            ours[name] = layers.digest(parts)
        if (theirs := known["layers"].get(name)) not in (None, ours[name]):
            different.append(name)
        verdict = "new" if theirs is None else "differs" if name in different else EQUAL
        print(f"{name:32}{ours[name][:12]}  {verdict}", flush=True)
    summary = f"{different[0]!r} differs first" if different else "all layers are equal"
    then = known["versions"]
    changes = [
        f"{name} {then.get(name, 'none')} (here {here})"
        for name, here in versions().items()
        if then.get(name) != here
    ]
    if changes:
        summary = f"the published layers are of {', '.join(changes)}"
    print(f"{machine.processor()}, {time.perf_counter() - started:.0f} s: {summary}")
    return ours, different


def main() -> None:
    """Parse the command line, compute and compare."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--publish", action="store_true", help="add this processor")
    options = parser.parse_args()
    known = published() if PATH.exists() else {"versions": {}, "layers": {}, "processors": {}}
    ours, different = compare(known)
    if options.publish:
        has_changed = known["processors"].get(machine.processor(), different) != different
        if known["versions"] != versions() or has_changed or ours.keys() != known["layers"].keys():
            known, different = {"versions": versions(), "layers": ours, "processors": {}}, []
        known["processors"][machine.processor()] = different
        write_json(PATH, known)
        publish.replace_section(publish.TABLES, "layers", table(known))
    sys.exit(bool(different))


def table(known: Mapping[str, Any]) -> str:
    """Return the layers by processor, as a table of docs/tables.md."""
    processors = known["processors"]
    lines = ["| layer | " + " | ".join(processors) + " |", "| --- |" + " --- |" * len(processors)]
    for name, digest in known["layers"].items():
        cells = ["**differs**" if name in each else EQUAL for each in processors.values()]
        lines.append(f"| {name} (`{digest[:8]}`) | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
