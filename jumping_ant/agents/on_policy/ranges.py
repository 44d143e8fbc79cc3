"""What a search may choose for on-policy algorithms."""

from jumping_ant.agents.ranges import EPISODES, Between, OneOf, Ranges, whole

_ROUNDS: Ranges = {
    **EPISODES,
    "learning_rate": Between(1e-4, 5e-3),
    "gamma": Between(0.85, 0.995, is_log=False),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "gae_lambda": Between(0.8, 1.0, is_log=False),
    "vf_coef": Between(1e-4, 0.5),
    "log_std_init": Between(-1.5, 0.0, is_log=False),
    "max_grad_norm": Between(0.1, 5.0),
    "velocity_scale": Between(0.03, 0.3),
}

RANGES: dict[str, Ranges] = {
    "a2c": {
        **_ROUNDS,
        "n_steps": OneOf((4, 5, 8, 16, 32)),
        "normalize_advantage": OneOf((True, False)),
    },
    # Batches must divide a round; with the environments of presets/families these do.
    "ppo": {
        **_ROUNDS,
        "n_steps": OneOf((8, 16, 32, 64)),
        "batch_size": OneOf((64, 128, 256)),
        "n_epochs": whole(3, 20),
        "clip_range": Between(0.1, 0.4, is_log=False),
    },
}
