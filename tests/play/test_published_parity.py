"""What README.md says of the live page, against `results/play.json`, and its limits."""

import json

import committed
import pytest

from jumping_ant.play import reference

README = " ".join(committed.text("README.md").split())
PUBLISHED = json.loads(committed.text("results/play.json"))


@pytest.mark.parametrize("agent", PUBLISHED["agents"])
def test_readme_states_what_was_measured(agent: str) -> None:
    own = PUBLISHED["agents"][agent]
    assert own["steps"] == reference.STEPS
    assert f"a control step from {reference.STATES:,} recorded states agrees to 1e-13" in README
    assert own["one_step_error"] < 1e-13
    assert "trajectories under the same torques to 1e-6 for more than five seconds" in README
    assert own["horizon"] > 500 and own["max_error"] < 1e-12
    assert "torques to 1e-6" in README
    assert own["policy_error"] < 1e-6
    assert "returns of every agent's held-out episodes are equivalent" in README
    assert own["returns"] == "equivalent"


def test_the_page_is_small_and_quick() -> None:
    assert PUBLISHED["size_mb"] <= 25
    assert PUBLISHED["seconds_until_moving"] <= 3
    assert PUBLISHED["times_real_time"] >= 1
