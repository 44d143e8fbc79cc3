"""What a Python file does: its text without comments, docstrings and blank lines.

Digests of code are of this text, so that a mended comment reruns nothing. It is no printed syntax
tree, as each version of Python prints these differently.
"""

import hashlib
import io
import tokenize
from pathlib import Path

_QUOTES = ("'", '"')


def read(path: Path) -> str:
    """Return what a file does: of a Python file its effective text, of another all of it."""
    text = path.read_text(encoding="utf-8")
    return effective(text) if path.suffix == ".py" else text


def digest(path: Path) -> str:
    """Return the SHA-256 of what a file does."""
    return hashlib.sha256(read(path).encode()).hexdigest()


def effective(text: str) -> str:
    """Return Python source without comments, blank lines, and statements that are only a string."""
    lines = list(io.StringIO(text))
    statement: list[tokenize.TokenInfo] = []
    for token in tokenize.generate_tokens(iter(lines.copy()).__next__):
        row = token.start[0] - 1
        if token.type == tokenize.COMMENT:
            lines[row] = lines[row][: token.start[1]].rstrip() + "\n"
        elif token.type == tokenize.NL:
            lines[row] = lines[row] if lines[row].strip() else ""
        elif token.type == tokenize.NEWLINE:
            if all(map(_is_plain_string, statement)):
                first = statement[0].start[0] - 1
                lines[first : row + 1] = [""] * (row + 1 - first)
            statement = []
        elif token.type not in (tokenize.INDENT, tokenize.DEDENT):
            statement.append(token)
    return "".join(lines)


def _is_plain_string(token: tokenize.TokenInfo) -> bool:
    return token.type == tokenize.STRING and token.string.lstrip("bBrRuU").startswith(_QUOTES)
