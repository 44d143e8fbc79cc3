"""A project of four agents whose report tests read, and the charts of a report."""

import json
import re

AGENTS = {"random": "random", "dqn": "dqn", "sac": "sac", "pgpe": "pgpe"}
SEEDS = [3, 1, 7, 5]
FILM = {"width": 64, "height": 64, "fps": 10, "seconds": 1.0, "shadow_size": 0}


def charts(html: str) -> dict:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.S)
    assert found
    return json.loads(found[1])
