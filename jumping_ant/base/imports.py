"""The project files that a file imports: what its results depend on besides parameters."""

import ast
import functools
from pathlib import Path

from jumping_ant.base.files import CODE_ROOT


@functools.cache  # each stage of the digests imports much that others import
def direct(path: Path, root: Path = CODE_ROOT) -> frozenset[Path]:
    """Return the project's files that a Python file imports, except empty ones."""
    found: set[Path] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(root).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            names = [f"{module}.{alias.name}" for alias in node.names] + [module]
        else:
            continue
        found |= {file for name in names for file in files_of(name, root)}
    return frozenset(found)


def files_of(module: str, root: Path = CODE_ROOT) -> set[Path]:
    """Return the project's non-empty files that importing a module runs, with parent packages."""
    parts = module.split(".") if module else []
    places = [root.joinpath(*parts[: length + 1]) for length in range(len(parts))]
    files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
    return {file for file in files if file.is_file() and file.stat().st_size > 0}


def closure(*paths: Path, root: Path = CODE_ROOT) -> set[Path]:
    """Return the given files and all project files that they import, directly or indirectly."""
    done: set[Path] = set()
    waiting = set(paths)
    while waiting:
        file = waiting.pop()
        done.add(file)
        waiting |= direct(file, root) - done
    return done
