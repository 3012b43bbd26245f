"""The policy: a small network from what a drone senses to what it commands. All drones have the same weights."""

import json
from pathlib import Path

import numpy as np

#: What a drone is shown: the nearest neighbours and the nearest obstacles. It is the same in training and in flight.
NEIGHBOURS, OBSTACLES = 2, 2
#: Inputs of the network, hidden units, and outputs: accelerations to the east and to the north.
INPUTS, HIDDEN, OUTPUTS = 2 + 3 * NEIGHBOURS + 3 * OBSTACLES, 12, 2
#: Number of weights.
SIZE = HIDDEN * (INPUTS + 1) + OUTPUTS * (HIDDEN + 1)
#: Velocities are given to the network in this unit, m/s, and this is its greatest acceleration, m/s².
SPEED_MPS, STRENGTH_MPS2 = 5.0, 4.0
WEIGHTS = Path(__file__).with_name("weights.json")


def features(rows):
    """The inputs of the network, from rows as ``skein.Swarm.observations`` has them."""
    inputs = [rows[..., 3] / SPEED_MPS - 1.0, rows[..., 4] / SPEED_MPS]
    at = 6
    for reach_m, count, width in ((10.0, NEIGHBOURS, 7), (20.0, OBSTACLES, 5)):
        for _ in range(count):
            there, x, y = rows[..., at], rows[..., at + 1], rows[..., at + 2]
            distance = np.maximum(np.hypot(x, y), 0.1)
            # A direction that fades with the distance, and a warning that is strong only near by.
            near = there * np.exp(-distance / reach_m)
            inputs += [near * x / distance, near * y / distance, near**3]
            at += width
    return np.stack(inputs, axis=-1)


def act(weights, rows):
    """Accelerations, m/s²: three numbers for each row. ``weights``: those of one policy, and ``rows`` one row per drone; or one
    policy per entry, and for each of them rows of its own."""
    rows = np.asarray(rows, np.float64)
    split = HIDDEN * (INPUTS + 1)
    first = weights[..., :split].reshape(*weights.shape[:-1], INPUTS + 1, HIDDEN)
    second = weights[..., split:].reshape(*weights.shape[:-1], HIDDEN + 1, OUTPUTS)
    hidden = np.tanh(features(rows) @ first[..., 1:, :] + first[..., :1, :])
    plane = STRENGTH_MPS2 * np.tanh(hidden @ second[..., 1:, :] + second[..., :1, :])
    # Drones hold their altitude.
    return np.concatenate([plane, -rows[..., 5:6]], axis=-1)


def load(path=WEIGHTS):
    """The trained weights."""
    return np.array(json.loads(Path(path).read_text())["weights"])
