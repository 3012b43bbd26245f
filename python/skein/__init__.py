"""Skein: a swarm runtime in which every drone is a process.

A pilot is a class with a method ``step``::

    import skein

    class Brake(skein.Pilot):
        def step(self, senses, inbox, out):
            vx, vy, vz = senses.velocity_mps
            return skein.Acceleration(-vx, -vy, -vz)

    if __name__ == "__main__":
        skein.main(brake=Brake)

``main`` makes the script an application that answers to all commands of Skein: ``python brake.py run scenario.toml``.
``run``, ``sweep`` and ``load`` are for notebooks. ``Env``, ``parallel_env`` and ``vector_env`` are environments for
reinforcement learning; ``Swarm`` is what they step, without any of their dependencies.

Positions are in metres, velocities in m/s, in the world frame: x east, y north, z up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._app import Error, main
from ._flights import Run, load, run, sweep
from ._pilot import ParamError, Pilot
from ._skein import (
    Acceleration,
    Birth,
    Inbox,
    Message,
    Neighbour,
    Obstacle,
    Out,
    Senses,
    Velocity,
    __version__,
)

if TYPE_CHECKING:
    from ._env import Env, ParallelEnv, VectorEnv, parallel_env, vector_env
    from ._swarm import Swarm

__all__ = [
    "Acceleration",
    "Birth",
    "Env",
    "Error",
    "Inbox",
    "Message",
    "Neighbour",
    "Obstacle",
    "Out",
    "ParallelEnv",
    "ParamError",
    "Pilot",
    "Run",
    "Senses",
    "Swarm",
    "VectorEnv",
    "Velocity",
    "__version__",
    "load",
    "main",
    "parallel_env",
    "run",
    "sweep",
    "vector_env",
]

_SWARM = ("Swarm",)
_ENVIRONMENTS = ("Env", "ParallelEnv", "VectorEnv", "parallel_env", "vector_env")


def __getattr__(name: str) -> Any:
    """Imports what needs numpy and gymnasium when it is first used: a drone's process starts faster without them."""
    if name in _SWARM:
        from . import _swarm

        return getattr(_swarm, name)
    if name in _ENVIRONMENTS:
        from . import _env

        return getattr(_env, name)
    raise AttributeError(f"module 'skein' has no attribute {name!r}")
