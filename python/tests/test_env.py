"""The environments: their checkers, their radio and faults, and what they share with the runtime."""

from __future__ import annotations

import time
import warnings

import numpy as np
import pytest

import skein

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")

SCENE = """
seed = 3
formation = { shape = "line", drones = 4, spacing_m = 60, start_jitter_m = 5 }
time = { timeout_s = 2 }

[[obstacle]]
shape = "circle"
centre_m = [60, 5]
radius_m = 10
"""


def zeros(env_or_swarm):
    swarm = getattr(env_or_swarm, "swarm", env_or_swarm)
    return np.zeros_like(swarm.actions)


def test_pettingzoo_accepts_the_parallel_environment():
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    parallel_api_test(skein.parallel_env(SCENE, message=2), num_cycles=300)
    parallel_seed_test(lambda: skein.parallel_env(SCENE), num_cycles=50)


def test_gymnasium_accepts_the_environment():
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        # Positions have no natural bounds, and no warning is an error.
        warnings.simplefilter("ignore")
        check_env(skein.Env(SCENE), skip_render_check=True)


def test_a_vector_environment_is_one_mission_and_starts_the_next():
    env = skein.vector_env(SCENE)
    first, about = env.reset(seed=5)
    assert first.shape == (4, env.single_observation_space.shape[0]) and first in env.observation_space
    assert about["_now_s"].all()
    for _ in range(100):
        observations, rewards, terminated, truncated, _ = env.step(zeros(env))
        assert rewards.shape == terminated.shape == (4,)
    assert truncated.all() and not terminated.any()
    next_first, rewards, terminated, truncated, about = env.step(zeros(env))
    assert not truncated.any() and not rewards.any() and about["now_s"][0] == 0.0
    assert not np.array_equal(next_first, first), "another seed"


def test_a_seed_gives_the_same_mission_and_a_tick_is_the_runtime_s():
    swarm, again = skein.Swarm(SCENE, seed=1), skein.Swarm(SCENE)
    again.reset(1)
    actions = np.random.default_rng(0).normal(size=(50, 4, 3)).astype(np.float32)
    for action in actions:
        swarm.step(action)
        again.step(action)
    assert swarm.digest == again.digest
    assert np.array_equal(swarm.observations, again.observations)
    again.reset(2)
    again.step(actions[0])
    assert again.digest != swarm.digest


def test_steered_drones_accelerate_within_their_limits():
    swarm = skein.Swarm(SCENE)
    before = swarm.velocity_mps.copy()
    swarm.step([[0, 0, 1], [1e6, 0, 0], [0, 0, 0], [0, 0, 0]])
    gained = (swarm.velocity_mps - before) / swarm.dt_s
    limit = swarm.scenario["drone"]["acceleration_max_mps2"]
    assert gained[0] == pytest.approx([0, 0, 1])
    assert np.linalg.norm(gained[1]) <= limit + 1e-9
    assert gained[2] == pytest.approx([0, 0, 0])


def test_messages_take_as_long_as_the_radio_says_and_can_be_lost():
    swarm = skein.Swarm(SCENE, set={"radio.delay_s": 0.1}, message=1, peers=3)
    row = np.zeros((4, 4), np.float32)
    row[:, 3] = [10, 11, 12, 13]
    heard = swarm.observations[0, -12:].reshape(3, 4)
    for _ in range(4):
        swarm.step(row)
        assert not heard.any()
    for _ in range(3):
        swarm.step(row)
    assert sorted(heard[:, 3]) == [11, 12, 13]
    deaf = skein.Swarm(SCENE, set={"radio.loss": 1.0}, message=1)
    for _ in range(20):
        deaf.step(row)
    assert not deaf.observations[:, -16:].any()


def test_the_actions_of_a_slow_drone_take_effect_later():
    fault = {"fault": [{"kind": "slow", "drone": 1, "at_s": 0.0, "for_s": 1.0, "reaction_time_s": 0.1}]}
    swarm = skein.Swarm(SCENE, set=fault)
    before = swarm.velocity_mps.copy()
    late = round(0.1 / swarm.dt_s)
    for tick in range(late + 1):
        assert np.all(swarm.velocity_mps[1] == before[1]), f"nothing has happened before tick {tick}"
        swarm.step([[0, 0, 0], [0, 0, 1], [0, 0, 1], [0, 0, 0]])
        assert swarm.velocity_mps[2, 2] == pytest.approx(before[2, 2] + (tick + 1) * swarm.dt_s)
    assert swarm.velocity_mps[1, 2] == pytest.approx(before[1, 2] + swarm.dt_s)
    while swarm.now_s < 1.5:
        swarm.step([[0, 0, 0]] * 4)
    gained = swarm.velocity_mps - before
    assert gained[2, 2] == pytest.approx((late + 1) * swarm.dt_s), "what was commanded is done, and no more"
    assert gained[1, 2] <= gained[2, 2] + 1e-9


def test_a_killed_drone_leaves():
    fault = {"fault": [{"kind": "kill", "drone": 2, "at_s": 0.1}]}
    env = skein.parallel_env(SCENE, set=fault)
    env.reset(seed=1)
    left = None
    for tick in range(20):
        *_, terminated, truncated, _ = env.step({agent: np.zeros(3, np.float32) for agent in env.agents})
        if "drone_2" not in env.agents and left is None:
            left = tick
            assert terminated["drone_2"] and not terminated["drone_1"]
    assert left is not None and len(env.agents) == 3


def test_a_reward_is_one_number_per_drone():
    env = skein.parallel_env(SCENE, reward=lambda swarm: swarm.position_m[:, 0])
    env.reset()
    _, rewards, *_ = env.step({})
    assert rewards["drone_0"] == pytest.approx(env.swarm.position_m[0, 0])
    wrong = skein.Env(SCENE, reward=lambda swarm: 1.0)
    wrong.reset()
    with pytest.raises(ValueError, match="one per drone"):
        wrong.step(zeros(wrong))


def test_a_wrong_scenario_is_a_value_error_with_its_place():
    with pytest.raises(ValueError, match="dron"):
        skein.Swarm("formation = { dron = 4 }\n")


def test_a_batch_is_fast():
    """A tenth of what an idle core does: this catches a copy or a loop in Python, not a slow machine."""
    env = skein.parallel_env(
        'formation = { shape = "grid", drones = 100, spacing_m = 60 }\ntime = { timeout_s = 1000 }\n'
    )
    env.reset_batch(1)
    actions = zeros(env)
    start = time.process_time()
    for _ in range(500):
        env.step_batch(actions)
    assert 500 * 100 / (time.process_time() - start) > 2e5
