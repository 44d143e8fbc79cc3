"""What a search may choose for off-policy algorithms."""

from jumping_ant.agents.ranges import EPISODES, Between, OneOf, Ranges, whole

_NETWORKS: Ranges = {
    **EPISODES,
    "learning_rate": Between(1e-4, 3e-3),
    "gamma": Between(0.85, 0.995, is_log=False),
    "batch_size": OneOf((64, 128, 256, 512)),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "n_steps": whole(1, 4, is_log=False),
    "velocity_scale": Between(0.03, 0.3),
}
_STARTS: Ranges = {"learning_starts": whole(250, 2500)}
_CRITICS: Ranges = {
    **_NETWORKS,
    **_STARTS,
    "gradient_steps": whole(1, 16),
    "tau": Between(0.002, 0.05),
}
_ENTROPY: Ranges = {"ent_coef": Between(0.01, 0.5)}
_VALUES: Ranges = {
    **_NETWORKS,
    **_STARTS,
    "gradient_steps": whole(2, 16),
    "target_update_interval": whole(500, 8000),
    "exploration_fraction": Between(0.05, 0.8, is_log=False),
    "exploration_final_eps": Between(0.005, 0.1),
}
_DETERMINISTIC: Ranges = {
    **_CRITICS,
    "learning_starts": whole(250, 5000),
    "action_noise": Between(0.03, 1.0),
}
_SMOOTHED: Ranges = {
    **_DETERMINISTIC,
    "policy_delay": whole(1, 4, is_log=False),
    "target_policy_noise": Between(0.05, 0.5, is_log=False),
}

RANGES: dict[str, Ranges] = {
    "dqn": _VALUES,
    "decqn": _VALUES,
    "qrdqn": _VALUES,
    "sac": {**_CRITICS, **_ENTROPY},
    "tqc": {**_CRITICS, **_ENTROPY, "top_quantiles_to_drop_per_net": whole(0, 8, is_log=False)},
    "crossq": {
        **_NETWORKS,
        **_STARTS,
        **_ENTROPY,
        "gradient_steps": whole(1, 8),
        "policy_delay": whole(1, 4, is_log=False),
    },
    "ddpg": _DETERMINISTIC,
    "td3": _SMOOTHED,
}
