"""What this machine computes, compared with what was published, layer by layer."""

import re

import pytest

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import machine, portable
from scripts import fingerprint, layers

KNOWN = fingerprint.published()


def test_the_published_layers_are_of_these_versions() -> None:
    assert set(KNOWN["layers"]) == {name for name, _ in layers.layers()}
    assert {f"training: {name}" for name in ALGORITHMS} < set(KNOWN["layers"])
    assert KNOWN["processors"]


@pytest.mark.skipif(not portable.is_supported(), reason="a processor with bytes of its own")
def test_every_layer_is_as_published(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = fingerprint.versions()
    others = {key for key, version in KNOWN["versions"].items() if ours[key] != version}
    if others - {fingerprint.RENDERER}:
        pytest.skip(f"published are the layers of other versions of {', '.join(sorted(others))}")
    monkeypatch.setattr("sys.argv", ["fingerprint"])
    with pytest.raises(SystemExit) as ended:
        fingerprint.main()
    told = capsys.readouterr().out
    different = {line.split()[0] for line in told.splitlines() if line.endswith("  differs")}
    # Mesa compiles for the processor; films were compared on others only.
    may_differ = {"film"} if others or machine.processor() not in KNOWN["processors"] else set()
    assert different <= may_differ, told
    assert ended.value.code == bool(different)
    assert len(re.findall(r"  equal$", told, re.MULTILINE)) == len(KNOWN["layers"]) - len(different)
