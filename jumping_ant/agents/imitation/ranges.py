"""What a search may choose for imitators."""

from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole

_FITS: Ranges = {
    "learning_rate": Between(2e-4, 5e-3),
    "batch_size": OneOf((64, 128, 256)),
    "net_arch": OneOf(([64, 64], [128, 128], [256, 256])),
    "rounds": whole(4, 32),
    "updates_per_round": whole(100, 2000),
    "velocity_scale": Between(0.03, 0.3),
}

RANGES: dict[str, Ranges] = {"bc": _FITS, "dagger": _FITS}
