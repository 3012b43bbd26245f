"""Flies the trained policy: ``python examples/learn/gap.py run examples/learn/gap.toml``."""

import numpy as np
import policy

import skein

#: A drone is done beyond this, m.
THROUGH_M = 90.0


class Gap(skein.Pilot):
    def __init__(self, birth):
        self.weights = policy.load(birth.params.get("weights", policy.WEIGHTS))

    def step(self, senses, inbox, out):
        out.done(senses.position_m[0] > THROUGH_M)
        return skein.Acceleration(*policy.act(self.weights, row(senses)[np.newaxis])[0])


def row(senses):
    """What the drone senses, as a row of ``skein.Swarm.observations``."""
    row = np.zeros(6 + 7 * policy.NEIGHBOURS + 5 * policy.OBSTACLES)
    row[:6] = *senses.position_m, *senses.velocity_mps
    near = sorted(senses.neighbours, key=lambda other: np.dot(other.position_m, other.position_m))
    for number, other in enumerate(near[: policy.NEIGHBOURS]):
        row[6 + 7 * number :][:7] = 1.0, *other.position_m, *other.velocity_mps
    around = sorted(senses.obstacles, key=lambda obstacle: obstacle.distance_m)
    for number, obstacle in enumerate(around[: policy.OBSTACLES]):
        point = np.subtract(obstacle.nearest_m, senses.position_m)
        row[6 + 7 * policy.NEIGHBOURS + 5 * number :][:5] = 1.0, *point, obstacle.distance_m
    return row


if __name__ == "__main__":
    skein.main(gap=Gap)
