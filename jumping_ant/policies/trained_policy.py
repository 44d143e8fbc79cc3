"""The policies of a seed: those that its training wrote."""

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import SeedPaths
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy


def load(paths: SeedPaths, is_final: bool = False) -> Policy:
    """Read a seed's published policy, or its final one (see `SeedPaths.content`)."""
    path = paths.final_policy if is_final else paths.policy
    content = paths.content(path)
    try:
        return policy_file.parse(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
