#!/usr/bin/env python3
"""Measures what pilots and environments in Python cost. It needs the module skein: pip install './python[rl]'.

    scripts/python_costs.py bench pilots cruise,trivial               eight drones in one thread
    scripts/python_costs.py bench pilots cruise,trivial --processes   eight drones, a process each
    scripts/python_costs.py batch                                     100 drones, steered by arrays, on one core

The first two are commands of Skein, with a pilot in Python that does nothing. Ratios are those of the rounds of one run.
"""

from __future__ import annotations

import os
import statistics
import sys
import time

import skein

#: A hundred drones in the open, for almost ten hours: no mission ends while it is measured.
SCENE = """
formation = { shape = "grid", drones = 100, spacing_m = 65 }
drone = { safe_distance_m = 37 }
mission = { end = "time", duration_s = 35000 }
time = { timeout_s = 36000 }
"""
ROUNDS = 9
ROUND_S = 1.0


class Trivial(skein.Pilot):
    """Commands no acceleration."""

    def step(self, senses, inbox, out):
        return skein.Acceleration(0.0, 0.0, 0.0)


def batch() -> None:
    """Prints the agent-steps per second of the environments' batched forms."""
    import numpy as np

    core = min(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    swarm, env = skein.Swarm(SCENE), skein.parallel_env(SCENE)
    swarm.reset(seed=1)
    env.reset_batch(seed=1)
    actions = np.zeros_like(swarm.actions)
    cases = {"skein.Swarm.step": swarm.step, "parallel_env.step_batch": env.step_batch}
    measured: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(ROUNDS):
        for name, step in cases.items():
            steps, begin = 0, time.perf_counter()
            while (wall_s := time.perf_counter() - begin) < ROUND_S:
                for _ in range(100):
                    step(actions)
                steps += 100
            measured[name].append(steps * swarm.drones / wall_s)
    for name, rates in measured.items():
        median, least, most = (rate / 1e6 for rate in (statistics.median(rates), min(rates), max(rates)))
        print(f"{name:<24} {median:.2f} million agent-steps/s ({least:.2f} to {most:.2f} in {ROUNDS} rounds), {swarm.drones} drones")


if __name__ == "__main__":
    if sys.argv[1:] == ["batch"]:
        batch()
    else:
        skein.main(trivial=Trivial)
