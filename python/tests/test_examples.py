"""The examples in Python: what they show is so."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest
from test_pilots import app

import skein

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def load(monkeypatch):
    """Imports a module of an example, which may import others of its folder."""

    def load(folder, name):
        monkeypatch.syspath_prepend(str(EXAMPLES / folder))
        spec = importlib.util.spec_from_file_location(name, EXAMPLES / folder / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    return load


def test_the_learnt_policy_passes_gaps_that_training_did_not_have(load):
    train, policy = load("learn", "train"), load("learn", "policy")
    weights = policy.load()[None]
    successes = []
    for number, gap_m in enumerate((-9.0, -7.0, -3.0, -1.0, 0.0, 2.0, 4.0, 6.0, 7.5, 9.0)):
        swarm = [train.swarm(gap_m)]
        for seed in (train.TEST_SEED + 2 * number, train.TEST_SEED + 2 * number + 1):
            successes.append(bool(train.fly(swarm, weights, seed, gap_m)[1][0]))
    assert sum(successes) >= 18, successes


@pytest.mark.parametrize("runtime", ["inline", "processes"])
def test_the_learnt_policy_flies_as_a_pilot(tmp_path, runtime):
    scenario = EXAMPLES / "learn" / "gap.toml"
    words = ["run", scenario, "--json", "--no-record", "--seed", 2_000_001, "--runtime", runtime]
    done = app(tmp_path, *words, script=EXAMPLES / "learn" / "gap.py", check=0)
    summary = json.loads(done.stdout)
    assert summary["outcome"] == "reached" and summary["violations"] == [] and summary["failures"] == []


def test_training_makes_a_policy_better_and_writes_its_curve(load, tmp_path, monkeypatch):
    train, policy = load("learn", "train"), load("learn", "policy")
    monkeypatch.setattr(sys, "argv", ["train.py", "--generations", "2", "--pairs", "2", "--out", str(tmp_path)])
    train.main()
    assert policy.load(tmp_path / "weights.json").shape == (policy.SIZE,)
    assert (tmp_path / "curve.svg").read_text().count("<polyline") == 2
    _, curve = train.train(12, 6, 1)
    assert max(returns for returns, _ in curve[6:]) > curve[0][0]


def test_under_loss_the_bully_has_false_leaders_and_skein_hardly_any(load):
    load("bully", "bully")
    compare = load("bully", "compare")
    several = {}
    for flown in (compare.of_bully, compare.of_skein):
        for loss in (0.0, 0.75):
            runs = [flown(loss, seed) for seed in (1, 2)]
            several[flown.__name__, loss] = sum(len(now) > 1 for run in runs for now in run)
            assert all(compare.wait_s(run, since_s) < 20.0 for run in runs for since_s in (0.0, compare.KILL_S))
    assert several["of_bully", 0.0] == several["of_skein", 0.0] == 0
    assert several["of_bully", 0.75] > 10 * several["of_skein", 0.75]


def test_consensus_is_the_mean_of_the_start_values(load):
    consensus = load("consensus", "consensus")
    run = skein.run(EXAMPLES / "consensus" / "hover.toml", pilots={"consensus": consensus.Agent}, record=False)
    assert run.outcome == "reached"
    value = run.summary["metrics_own"]["value"]
    assert value["last"] == pytest.approx(3.5, abs=0.1)
