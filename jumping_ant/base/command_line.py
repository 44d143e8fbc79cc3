"""The parser of a command's arguments, whose help begins with the command's docstring."""

import argparse


def parser(docstring: str | None, name: str | None = None) -> argparse.ArgumentParser:
    """Return a parser whose help has a docstring's first line (`-OO` drops docstrings)."""
    return argparse.ArgumentParser(prog=name, description=(docstring or "").partition("\n")[0])
