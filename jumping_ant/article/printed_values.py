"""The results that the article printed.

Source: the outputs of `mujoco_gym.ipynb` in the repository of its author, github.com
mdipietro09/RoboticsPy, November 2025.
"""

# DQN and SAC were tested once each, for 1,000 control steps of the trained model, exploring as in
# training and never reset: the total of the rewards by control step.
TEST_STEPS = 1000
DQN_TOTALS = {
    1: 0.9,
    100: 1.9,
    200: 60.0,
    300: 121.8,
    400: 198.8,
    500: 267.8,
    600: 325.7,
    700: 325.7,
    800: 437.4,
    900: 527.5,
    1000: 527.5,
}
SAC_TOTALS = {
    1: 1.3,
    100: 785.3,
    200: 1729.2,
    300: 2412.0,
    400: 3257.6,
    500: 4059.2,
    600: 4926.7,
    700: 5802.7,
    800: 6678.0,
    900: 7430.4,
    1000: 8311.7,
}
# PGPE's fitness by generation, minus 1 per control step: EvoTorch's mean_eval, pop_best_eval and
# median_eval of the population, by the names of our learning curves.
PGPE_TRACES = {
    "fitness_mean": {20: -29.1, 40: -34.5, 60: 53.4, 80: 81.7, 100: 110.4},
    "fitness_best": {20: 166.0, 40: 275.5, 60: 439.7, 80: 497.8, 100: 605.1},
    "fitness_median": {20: -35.8, 40: -75.5, 60: 8.1, 80: -37.3, 100: 52.2},
}
# The film of the policy at PGPE's centre: one episode until it ended.
PGPE_FILM_FITNESS = 50741.5  # minus 1 per control step
PGPE_FILM_STEPS = 11865
# [h] Training times that the article states; the notebook says 1 h of DQN.
STATED_HOURS = {"dqn": 20 / 60, "sac": 3.0, "pgpe": 1.0}
