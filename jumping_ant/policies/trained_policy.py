"""The policies of a seed: the files that its training wrote, and no others."""

import hashlib

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import read_bytes, read_json
from jumping_ant.base.paths import SeedPaths
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy


def content(paths: SeedPaths, is_final: bool = False) -> bytes:
    """Return the content of a seed's published policy file, or of its final one.

    Raises:
        InputError: There is none, or it is not the one whose digest its training has left, which is
            in git, unlike the file itself.
    """
    path = paths.final_policy if is_final else paths.policy
    agent, seed = paths.owner
    found = read_bytes(path, f"train@{agent}")
    if paths.trained.exists():  # once all seeds are trained
        digests = read_json(paths.trained, f"train@{agent}").get(str(seed)) or {}
        given, allowed = hashlib.sha256(found).hexdigest(), digests.get(path.name)
        if given != allowed:
            raise InputError(
                f"{path}: given another file than was trained, of SHA-256 {given[:8]}..., allowed: "
                f"{f'{allowed[:8]}...' if allowed else 'none'}, as in {paths.trained}; "
                f"`dvc repro --force train@{agent}` trains it again"
            )
    return found


def load(paths: SeedPaths, is_final: bool = False) -> Policy:
    """Read a seed's published policy, or its final one (see `content`)."""
    found = content(paths, is_final)
    try:
        return policy_file.parse(found, paths.owner)
    except InputError as error:
        raise InputError(f"{paths.folder}: {error}") from error
