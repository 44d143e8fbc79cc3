"""Write the map of the modules, docs/map.md, from the first line of each docstring.

Usage: python -m scripts.module_map (`make map`)
"""

import ast
from pathlib import Path

from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, write_text
from scripts import marks

PATH = PROJECT_ROOT / "docs" / "map.md"
LIBRARY = PROJECT_ROOT / "jumping_ant"
# Shared ground, in the order of the data flow; then the rooms of the stages, side by side.
GROUND = ["base", "compute", "params", "actions.py", "policies", "sim", "looks", "agents"]
GROUND += ["experiment"]
ROOMS = ["training", "evaluation", "comparison", "recording", "report", "speed", "robustness"]
ROOMS += ["play", "tracking", "tuning", "article"]


def text(before: str) -> str:
    """Return the content of docs/map.md with the current modules."""
    content = "".join(_section(LIBRARY / place) for place in [*GROUND, *ROOMS])
    return marks.replaced(PATH, before, "modules", content)


def _section(place: Path) -> str:
    """Return the table of a folder and its subfolders, or the line of a module."""
    if place.is_file():
        return f"\n### `{place.name}`\n\n{_first_line(place)}\n"
    rows = [
        f"| `{path.relative_to(place)}` | {_first_line(path)} |\n"
        for path in sorted(place.rglob("*.py"), key=lambda path: (len(path.parts), path))
        if path.stat().st_size
    ]
    return f"\n### `{place.name}/`\n\n| module | what it is |\n|---|---|\n{''.join(rows)}"


def _first_line(path: Path) -> str:
    """Return the first sentence of a module's docstring."""
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return docstring.partition("\n\n")[0].replace("\n", " ").replace("|", "\\|")


if __name__ == "__main__":
    with reported():
        write_text(PATH, text(PATH.read_text(encoding="utf-8")))
