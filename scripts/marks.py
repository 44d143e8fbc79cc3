"""Texts of documents between the marks `<!-- name -->` and `<!-- end of name -->`."""

from pathlib import Path

from jumping_ant.base.errors import InputError


def between(document: Path, text: str, name: str) -> str:
    """Return what a document's text has between the marks of a name.

    Raises:
        InputError: It lacks a mark.
    """
    return _parts(document, text, name)[1].removesuffix("\n")


def replaced(document: Path, text: str, name: str, content: str) -> str:
    """Return a document's text with other content there.

    Raises:
        InputError: It lacks a mark.
    """
    head, _, tail = _parts(document, text, name)
    return f"{head}{content.rstrip()}\n{tail}"


def _parts(document: Path, text: str, name: str) -> tuple[str, str, str]:
    """Return a text up to a mark and with it, from there to the next, and the rest."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    head, found_begin, rest = text.partition(begin)
    content, found_end, tail = rest.partition(end)
    if not (found_begin and found_end):
        raise InputError(f"{document}: given no {begin.strip()} ... {end}, between which to write")
    return head + begin, content, end + tail
