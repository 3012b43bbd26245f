"""Environments for reinforcement learning: Gymnasium and PettingZoo. They need ``pip install './python[rl]'``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ._flights import Scenario
from ._swarm import Swarm

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv as _VectorEnv
    from pettingzoo import ParallelEnv as _ParallelEnv
except ImportError as error:
    raise ImportError(f"environments need gymnasium and pettingzoo: pip install gymnasium pettingzoo ({error})") from error

#: A reward: from the swarm after a tick, one number per drone.
Reward = Callable[[Swarm], Any]

#: The greatest number that an observation can have. It is far beyond every scenario.
_FAR = np.float32(1e9)


def progress(swarm: Swarm) -> NDArray[np.float64]:
    """The default reward: metres flown in the direction of the mission in this tick, and 10 less for a violation.

    The direction is that of the goal, or x in a mission without one.
    """
    goal = swarm.scenario["mission"].get("goal_m")
    if goal is None:
        along = swarm.velocity_mps[:, 0] * swarm.dt_s
    else:
        way = np.asarray(goal[:2]) - swarm.position_m[:, :2]
        length = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
        along = np.einsum("ij,ij->i", swarm.velocity_mps[:, :2], way) / length * swarm.dt_s
    return along - 10.0 * swarm.violated


class _Mission:
    """What the environments share: a swarm, its spaces and its rewards."""

    def __init__(self, scenario: Scenario, reward: Reward | None, options: Mapping[str, Any]) -> None:
        self.swarm = Swarm(scenario, **options)
        self.reward = reward if reward is not None else progress
        limit = np.float32(self.swarm.scenario["drone"]["acceleration_max_mps2"])
        values = self.swarm.actions.shape[1] - 3
        high = np.concatenate([np.full(3, limit, np.float32), np.full(values, 1.0, np.float32)])
        self.action = spaces.Box(-high, high, dtype=np.float32)
        width = self.swarm.observations.shape[1]
        self.observation = spaces.Box(-_FAR, _FAR, (width,), np.float32)
        self._resets = 0

    def reset(self, seed: int | None, random: np.random.Generator) -> None:
        """A mission with this seed; without, the scenario's own first, and then others by chance."""
        if seed is None and self._resets > 0:
            seed = int(random.integers(2**31))
        self._resets += 1
        self.swarm.reset(seed)

    def rewards(self) -> NDArray[np.float64]:
        rewards = np.asarray(self.reward(self.swarm), dtype=np.float64)
        if rewards.shape != (self.swarm.drones,):
            raise ValueError(f"the reward has the shape {rewards.shape}, expected ({self.swarm.drones},): one per drone")
        return rewards

    @property
    def over(self) -> tuple[bool, bool]:
        """Whether the mission has ended by itself, and whether its time ran out."""
        outcome = self.swarm.outcome
        return outcome not in (None, "timeout"), outcome == "timeout"

    def about(self) -> dict[str, Any]:
        return {"now_s": self.swarm.now_s, "outcome": self.swarm.outcome, "violations": self.swarm.violations}


class Env(gymnasium.Env[Any, Any]):
    """A mission as one Gymnasium environment: an observation and an action have one row per drone, the reward is the mean over
    the drones. It steps the inline runtime; see ``skein.Swarm`` for what the rows hold.

    ``reward(swarm)`` gives one number per drone, from ``swarm.position_m``, ``swarm.velocity_mps``, ``swarm.observations`` and so
    on; the default is ``progress``. The other arguments are those of ``skein.Swarm``.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, scenario: Scenario, reward: Reward | None = None, **options: Any) -> None:
        self._mission = _Mission(scenario, reward, options)
        self.swarm = self._mission.swarm
        drones = self.swarm.drones
        self.action_space = _rows(self._mission.action, drones)
        self.observation_space = _rows(self._mission.observation, drones)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts a mission. With a seed, always the same one."""
        super().reset(seed=seed)
        self._mission.reset(seed, self.np_random)
        return self.swarm.observations.copy(), self._mission.about()

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Flies one tick."""
        self.swarm.step(action)
        terminated, truncated = self._mission.over
        about = self._mission.about()
        rewards = self._mission.rewards()
        about["rewards"] = rewards
        return self.swarm.observations.copy(), float(rewards.mean()), terminated, truncated, about


class VectorEnv(_VectorEnv[Any, Any, Any]):
    """A mission as a Gymnasium vector environment: each drone is one of its environments. All end together; a dead drone ends
    before. A step after the end starts the next mission (``AutoresetMode.NEXT_STEP``).

    The observations are a view of the swarm's memory with ``copy=False``: the next step writes over it.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, scenario: Scenario, reward: Reward | None = None, *, copy: bool = True, **options: Any) -> None:
        self._mission = _Mission(scenario, reward, options)
        self.swarm = self._mission.swarm
        self.num_envs = self.swarm.drones
        self.single_action_space = self._mission.action
        self.single_observation_space = self._mission.observation
        self.action_space = _rows(self._mission.action, self.num_envs)
        self.observation_space = _rows(self._mission.observation, self.num_envs)
        self._copy = copy
        self._over = False

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Starts a mission. With a seed, always the same one; of several, the first counts."""
        if isinstance(seed, list):
            seed = seed[0] if seed else None
        super().reset(seed=seed)
        self._mission.reset(seed, self.np_random)
        self._over = False
        return self._observations(), self._about()

    def step(
        self, actions: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Flies one tick; after the end of a mission, starts the next one instead."""
        drones = self.num_envs
        if self._over:
            observations, about = self.reset()
            return observations, np.zeros(drones), np.zeros(drones, bool), np.zeros(drones, bool), about
        self.swarm.step(actions)
        terminated, truncated = self._mission.over
        self._over = terminated or truncated
        ended = np.full(drones, True) if terminated else ~self.swarm.alive
        rewards = self._mission.rewards()
        return self._observations(), rewards, ended, np.full(drones, truncated), self._about()

    def _observations(self) -> NDArray[np.float32]:
        return self.swarm.observations.copy() if self._copy else self.swarm.observations

    def _about(self) -> dict[str, Any]:
        """What is known of each environment, as Gymnasium wants it: an array, and another that says where it holds."""
        about: dict[str, Any] = {}
        for key, value in self._mission.about().items():
            about[key] = np.full(self.num_envs, value, object if key == "outcome" else None)
            about[f"_{key}"] = np.full(self.num_envs, True)
        return about


class ParallelEnv(_ParallelEnv):  # type: ignore[misc]
    """A mission as a PettingZoo ParallelEnv: its agents are ``drone_0`` and so on. A dead drone leaves.

    ``step`` and ``reset`` take and give dicts by agent. ``step_batch`` and ``reset_batch`` do the same with arrays, one row per
    drone, dead or alive, without copies: they are the fast form.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "skein_v0", "render_modes": [], "is_parallelizable": True}

    def __init__(self, scenario: Scenario, reward: Reward | None = None, **options: Any) -> None:
        self._mission = _Mission(scenario, reward, options)
        self.swarm = self._mission.swarm
        self.possible_agents = [f"drone_{drone}" for drone in range(self.swarm.drones)]
        self._number = {agent: drone for drone, agent in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        self.observation_spaces = {agent: self._mission.observation for agent in self.possible_agents}
        self.action_spaces = {agent: _own(self._mission.action) for agent in self.possible_agents}
        self.render_mode = None
        self._random = np.random.default_rng(self.swarm.seed)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """What ``agent`` observes; the same object at each call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """What ``agent`` can do; the same object at each call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, dict[str, Any]]]:
        """Starts a mission. With a seed, always the same one."""
        observations = self.reset_batch(seed).copy()
        self.agents = list(self.possible_agents)
        about = self._mission.about()
        return {agent: observations[self._number[agent]] for agent in self.agents}, {agent: dict(about) for agent in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, NDArray[np.float32]], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Flies one tick. A drone without an action does not accelerate."""
        self.swarm.actions[...] = 0.0
        for agent, action in actions.items():
            self.swarm.actions[self._number[agent]] = action
        observations, rewards, terminated, truncated = self.step_batch(None)
        observations, about, agents = observations.copy(), self._mission.about(), self.agents
        number = self._number
        self.agents = [agent for agent in agents if not (terminated[number[agent]] or truncated)]
        return (
            {agent: observations[number[agent]] for agent in agents},
            {agent: float(rewards[number[agent]]) for agent in agents},
            {agent: bool(terminated[number[agent]]) for agent in agents},
            {agent: truncated for agent in agents},
            {agent: dict(about) for agent in agents},
        )

    def reset_batch(self, seed: int | None = None) -> NDArray[np.float32]:
        """Starts a mission and gives the observations of all drones, as a view that the next step writes over."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        self._mission.reset(seed, self._random)
        return self.swarm.observations

    def step_batch(self, actions: Any) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], bool]:
        """Flies one tick with one row of ``actions`` per drone; None: with what is in ``self.swarm.actions``. Gives the observations
        as a view, the rewards, which drones have terminated, and whether the time ran out."""
        self.swarm.step(actions)
        terminated, truncated = self._mission.over
        ended = np.full(self.swarm.drones, True) if terminated else ~self.swarm.alive
        return self.swarm.observations, self._mission.rewards(), ended, truncated

    def render(self) -> None:
        """There is nothing to see here: a recorded run has a page."""

    def close(self) -> None:
        """Nothing is to be closed."""


def parallel_env(scenario: Scenario, reward: Reward | None = None, **options: Any) -> ParallelEnv:
    """A mission as a PettingZoo ParallelEnv. ``options``: those of ``skein.Swarm``."""
    return ParallelEnv(scenario, reward, **options)


def vector_env(scenario: Scenario, reward: Reward | None = None, **options: Any) -> VectorEnv:
    """A mission as a Gymnasium vector environment, one environment per drone. ``options``: those of ``skein.Swarm``."""
    return VectorEnv(scenario, reward, **options)


def _rows(space: spaces.Box, rows: int) -> spaces.Box:
    low, high = (np.tile(bound, (rows, 1)) for bound in (space.low, space.high))
    return spaces.Box(low, high, dtype=np.float32)


def _own(space: spaces.Box) -> spaces.Box:
    """An equal space with random numbers of its own."""
    return spaces.Box(space.low, space.high, dtype=np.float32)
