"""What this machine computes, compared with what was published, layer by layer."""

from typing import Any

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
@pytest.mark.parametrize(("name", "compute"), layers.layers(), ids=lambda given: str(given)[:40])
def test_every_layer_is_as_published(name: str, compute: Any) -> None:
    ours = fingerprint.versions()
    others = {key for key, version in KNOWN["versions"].items() if ours[key] != version}
    if others - {fingerprint.RENDERER} or (others and name == "film"):
        pytest.skip(f"published are the layers of other versions of {', '.join(sorted(others))}")
    if name == "film" and machine.processor() not in KNOWN["processors"]:
        pytest.skip("Mesa compiles for the processor; films were compared on others only")
    assert compute() == KNOWN["layers"][name], f"{name} differs on this processor"
