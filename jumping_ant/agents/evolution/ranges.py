"""What a search may choose for evolutionary algorithms.

Generations follow from the population and the episodes, so that all spend the same control steps.
"""

from jumping_ant.agents.ranges import Between, OneOf, Ranges, whole

_POPULATIONS: Ranges = {
    "population_size": OneOf((10, 16, 20, 30, 40)),
    "episode_steps": OneOf((100, 200, 300, 400)),
}
_WIDTHS: Ranges = {**_POPULATIONS, "stdev_init": Between(0.03, 1.0)}
_RATES: Ranges = {
    **_WIDTHS,
    "center_learning_rate": Between(0.3, 3.0),
    "stdev_learning_rate": Between(0.03, 3.0),
}

RANGES: dict[str, Ranges] = {
    "pgpe": {
        **_WIDTHS,
        "center_learning_rate": Between(0.01, 0.3),
        "stdev_learning_rate": Between(0.02, 0.5),
        "max_speed": Between(0.02, 0.5),
        "momentum": Between(0.5, 0.95, is_log=False),
    },
    "snes": _RATES,
    "xnes": _RATES,
    "cem": {**_WIDTHS, "parenthood_ratio": Between(0.2, 0.6, is_log=False)},
    "cmaes": {**_WIDTHS, "separable": OneOf((True, False))},
    "oscillator": {
        **_WIDTHS,
        "separable": OneOf((True, False)),
        "frequency": Between(1.0, 6.0),
    },
    "ars": {
        **_POPULATIONS,
        "learning_rate": Between(0.005, 0.3),
        "delta_std": Between(0.03, 1.0),
        "n_top": whole(1, 5),
    },
    "openai-es": {
        **_POPULATIONS,
        "learning_rate": Between(0.005, 0.5),
        "noise_stdev": Between(0.02, 1.0),
        "weight_decay": Between(5e-4, 0.05),
    },
}
