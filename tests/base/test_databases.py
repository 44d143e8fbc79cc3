"""Databases that several machines share."""

import pytest

from jumping_ant.base import databases


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("http://me:secret@host:5000/x", "http://host:5000/x"),
        ("postgresql://me:se/cr@et@host/db", "postgresql://host/db"),
        ("https://host/x?password=secret&a=b", "https://host/x"),
        ("https://host/x?password=sec@ret", "https://..."),
        ("mysql://a:se?cret@host/d", "mysql://..."),
        ("(mysql://a:secret@h/d) and (http://b:secret@i)", "(mysql://h/d) and (http://i)"),
        ("sqlite:////a/mlflow.db", "sqlite:////a/mlflow.db"),
    ],
)
def test_a_password_is_not_shown(given: str, shown: str) -> None:
    assert databases.without_password(given) == shown
