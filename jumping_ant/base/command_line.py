"""The parser of a command's arguments, whose help begins with the command's docstring."""

import argparse


def parser(docstring: str | None, name: str | None = None) -> argparse.ArgumentParser:
    """Return a parser for a command.

    Args:
        docstring: What the command does; only the first line is used. Python drops docstrings
            with `-OO`.
        name: How the command is called, where that is not its file's name.
    """
    return argparse.ArgumentParser(prog=name, description=(docstring or "").partition("\n")[0])
