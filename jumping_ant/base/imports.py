"""The project files that a file imports: what its results depend on besides parameters."""

import ast
import functools
from pathlib import Path

from jumping_ant.base.files import CODE_ROOT


@functools.cache  # each stage of the digests imports much that others import
def direct(path: Path, root: Path = CODE_ROOT) -> frozenset[Path]:
    """Return the project's files that a file imports, except empty ones.

    Args:
        path: A Python file.
        root: The folder that contains the project's packages.
    """
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(root).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            names = [f"{module}.{alias.name}" for alias in node.names] + [module]
        else:
            continue
        for name in names:
            parts = name.split(".")
            for length in range(1, len(parts) + 1):  # importing it runs its parent packages too
                place = root.joinpath(*parts[:length])
                found |= {place.with_suffix(".py"), place / "__init__.py"}
    return frozenset(file for file in found if file.is_file() and file.stat().st_size > 0)


def closure(*paths: Path, root: Path = CODE_ROOT) -> set[Path]:
    """Return the given files and all project files that they import, directly or indirectly."""
    done: set[Path] = set()
    waiting = set(paths)
    while waiting:
        file = waiting.pop()
        done.add(file)
        waiting |= direct(file, root) - done
    return done
