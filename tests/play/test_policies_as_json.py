"""Policies as plain JSON: every kind has a form, and the numbers and their digest are its own."""

import base64
import hashlib
import json

import numpy as np
import pytest
from known_policies import policies

from jumping_ant.play.policies import to_json
from jumping_ant.policies import policy_file
from jumping_ant.policies.networks import TanhActor


def test_every_kind_of_policy_file_has_a_form_and_nothing_else() -> None:
    known = policies(4, 2).values()
    assert {to_json(policy)["format"] for policy in known} == {1}
    assert all(issubclass(kind, (*map(type, known),)) for kind in policy_file.KINDS.values())
    with pytest.raises(TypeError, match="given a int"):
        to_json(3)  # type: ignore[arg-type]


def test_the_numbers_are_the_policys() -> None:
    policy = policies(4, 2)["tanh"]
    assert isinstance(policy, TanhActor)
    told = json.loads(json.dumps(to_json(policy)))
    assert told["actions"] == {"kind": "torques", "amplitude": 0.75, "hold": 3}
    assert list(told["arrays"]) == ["multiply", "weight_0", "bias_0", "weight_1", "bias_1"]
    weight = told["arrays"]["weight_1"]
    numbers = np.frombuffer(base64.b64decode(weight["float32"]), "<f4").reshape(weight["shape"])
    assert (numbers == policy.layers[1][0]).all()


def test_the_digest_is_that_of_all_numbers() -> None:
    told = to_json(policies(4, 2)["oscillators"])
    parts = [base64.b64decode(own["float64"]) for own in told["arrays"].values()]
    assert told["sha256"] == hashlib.sha256(b"".join(parts)).hexdigest()
