"""A swarm that is steered by arrays."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _skein
from ._flights import Scenario, _file, _toml

#: What an observation has for the drone itself: position and velocity.
OWN = 6
#: For each neighbour: whether there is one, its relative position and its relative velocity.
PER_NEIGHBOUR = 7
#: For each obstacle: whether there is one, its nearest point relative to the drone, and the distance to it.
PER_OBSTACLE = 5
#: For each message, before its values: whether there is one, the number of its sender, and its age in s.
PER_MESSAGE = 3


class Swarm:
    """All drones of a mission in this process, steered by arrays, with the radio and the faults of the scenario.

    ``step(actions)`` flies one tick. Row i of ``actions`` commands drone i: an acceleration in m/s² (x east, y north, z up), and
    ``message`` values that the drone broadcasts in this tick, if ``message`` is more than 0.

    Row i of ``observations`` is what drone i senses and has heard:

    - its position (m) and velocity (m/s), as its sensors report them: 6 numbers;
    - for each of ``neighbours`` drones, the nearest first: 1 if there is one, its relative position and velocity: 7 numbers;
    - for each of ``obstacles`` obstacles, the nearest first: 1 if there is one, the nearest point relative to the drone and the
      distance to it: 5 numbers;
    - with messages, the newest one of each of at most ``peers`` drones, the newest first: 1 if there is one, its sender, its age
      in s, and its values.

    ``position_m``, ``velocity_mps``, ``energy_j`` and ``alive`` are the truth after the last tick; ``violated`` says which drones
    began to break an invariant in it. All these arrays stay the same objects: copy what is to be kept.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        neighbours: int = 6,
        obstacles: int = 2,
        peers: int = 4,
        message: int = 0,
    ) -> None:
        with tempfile.TemporaryDirectory(prefix="skein-") as scratch:
            path = _file(scenario, scratch)
            with open(path, encoding="utf-8") as file:
                text = file.read()
        changes = [(key, _toml(value)) for key, value in (set or {}).items()]
        changes += [("seed", str(seed))] if seed is not None else []
        self._swarm = _skein.Swarm(
            text, os.fspath(path), changes, neighbours=neighbours, obstacles=obstacles, peers=peers, message=message
        )
        arrays = self._swarm.arrays()
        self.actions: NDArray[np.float32] = arrays["actions"]
        self.observations: NDArray[np.float32] = arrays["observations"]
        self.position_m: NDArray[np.float64] = arrays["position_m"]
        self.velocity_mps: NDArray[np.float64] = arrays["velocity_mps"]
        self.energy_j: NDArray[np.float64] = arrays["energy_j"]
        self.alive: NDArray[np.bool_] = arrays["alive"]
        self.violated: NDArray[np.bool_] = arrays["violated"]
        self.drones: int = self._swarm.drones
        self.dt_s: float = self._swarm.dt_s
        self.scenario: dict[str, Any] = self._swarm.scenario
        self.outcome: str | None = None
        self._step = self._swarm.step

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Goes back to the start of the mission; with another seed, to the start of that mission. Gives ``observations``."""
        self._swarm.reset(seed)
        self.outcome = None
        return self.observations

    def step(self, actions: Any = None) -> NDArray[np.float32]:
        """Flies one tick with these actions; without, with what is in ``self.actions``. Gives ``observations``. After the end of
        the mission it does nothing."""
        if actions is not None:
            self.actions[...] = actions
        self.outcome = self._step()
        return self.observations

    @property
    def now_s(self) -> float:
        """Simulated time, s."""
        return self._swarm.now_s

    @property
    def seed(self) -> int:
        """Seed of the mission."""
        return self._swarm.seed

    @property
    def digest(self) -> str:
        """The digest so far."""
        return self._swarm.digest

    @property
    def min_separation_m(self) -> float:
        """Least distance of two drones so far, m."""
        return self._swarm.min_separation_m

    @property
    def violations(self) -> int:
        """Violations of invariants so far."""
        return self._swarm.violations
