"""What a file imports: the project's files and libraries that its results depend on."""

import ast
import functools
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from jumping_ant.base.files import CODE_ROOT, PROJECT_ROOT

# Distributions that are not called as the module that they install.
DISTRIBUTIONS = {"PIL": "pillow", "rerun": "rerun-sdk", "ruamel": "ruamel-yaml"}
LOCK = PROJECT_ROOT / "requirements.lock"


@functools.cache  # each stage of the digests imports much that others import
def modules(path: Path, root: Path = CODE_ROOT) -> frozenset[str]:
    """Return the modules and names that a Python file imports, wherever it does."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = path.relative_to(root).parts[: -node.level] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            found |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return frozenset(found)


def direct(path: Path, root: Path = CODE_ROOT) -> set[Path]:
    """Return the project's files that a Python file imports."""
    return {file for name in modules(path, root) for file in files_of(name, root)}


def files_of(module: str, root: Path = CODE_ROOT) -> set[Path]:
    """Return the project's files that importing a module runs, with parent packages."""
    parts = module.split(".") if module else []
    places = [root.joinpath(*parts[: length + 1]) for length in range(len(parts))]
    files = {file for place in places for file in (place.with_suffix(".py"), place / "__init__.py")}
    return set(filter(Path.is_file, files))


def closure(*paths: Path, root: Path = CODE_ROOT) -> set[Path]:
    """Return the given files and all project files that they import, directly or indirectly."""
    done: set[Path] = set()
    waiting = set(paths)
    while waiting:
        file = waiting.pop()
        done.add(file)
        waiting |= direct(file, root) - done
    return done


def versions(files: Iterable[Path], *more: str, lock: Path = LOCK) -> dict[str, str]:
    """Return the locked version of each library that files import, or that holds `more` modules."""
    text = lock.read_text(encoding="utf-8") if lock.is_file() else ""
    locked = dict(re.findall(r"^([\w-]+)==(\S+)", text, re.MULTILINE))
    names = set(more).union(*(modules(file) for file in files if file.suffix == ".py"))
    tops = {name.partition(".")[0] for name in names} - sys.stdlib_module_names
    found = {DISTRIBUTIONS.get(top, top.replace("_", "-")) for top in tops}
    return {name: locked[name] for name in sorted(found & locked.keys())}
