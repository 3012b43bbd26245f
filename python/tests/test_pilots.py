"""Pilots in Python: as an application, from scripts, in both runtimes, and with their mistakes."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import gossip
import pytest

import skein

HERE = Path(__file__).parent
APP = HERE / "gossip.py"
BOIDS = HERE.parents[1] / "examples" / "boids"
HEAD = """
seed = 5
formation = { shape = "v", drones = 4, spacing_m = 60, start_jitter_m = 3 }
mission = { stop_x_m = 1e5 }
time = { timeout_s = 2 }
"""
GOSSIP = HEAD + '[[pilot]]\nname = "gossip"\nparams = { k = 0.25 }\n'
FIELD = """
formation = { shape = "circle", drones = 8, spacing_m = 25, start_jitter_m = 4 }
mission = { end = "time", duration_s = 20 }
drone = { speed_mps = 5, speed_change_mps = 2.5, safe_distance_m = 2 }
sensors = { detection_range_m = 40, ranging_m = 80 }
avoidance = { clearance_m = 2, planning_distance_m = 2 }
pilot = [{ name = "boids" }]
obstacle = [{ shape = "circle", centre_m = [80, 10], radius_m = 5 }]
"""


def app(folder, *words, script=APP, check=None):
    done = subprocess.run(
        [sys.executable, str(script), *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=120
    )
    if check is not None:
        assert done.returncode == check, done.stderr
    return done


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "gossip.toml"
    path.write_text(GOSSIP)
    return path


def digest(done):
    return json.loads(done.stdout)["digest"]


def test_an_application_flies_with_equal_digests_in_both_runtimes(tmp_path, scenario):
    words = ["run", scenario, "--json", "--set", "radio.loss=0.5"]
    processes = app(tmp_path, *words, "--out", "p", check=1)
    inline = app(tmp_path, *words, "--runtime", "inline", "--out", "i", check=1)
    packed = app(tmp_path, *words, "--drones-per-process", 4, "--out", "k", check=1)
    assert digest(processes) == digest(inline) == digest(packed)
    summary = json.loads(processes.stdout)
    assert summary["pilots"][0]["name"] == "gossip" and summary["failures"] == []
    app(tmp_path, "replay", "p", check=0)


def test_faults_do_to_python_what_they_do_to_rust(tmp_path, scenario):
    faults = '{ kind = "kill", drone = 1, at_s = 0.5 }, { kind = "freeze", drone = 2, at_s = 0.6, for_s = 0.5 }'
    words = ["run", scenario, "--json", "--set", f"fault=[{faults}]"]
    digests = {digest(app(tmp_path, *words, "--runtime", runtime, "--out", runtime)) for runtime in ("inline", "processes")}
    assert len(digests) == 1


def test_functions_fly_what_the_application_flies(tmp_path, scenario):
    inline = skein.run(scenario, pilots={"gossip": gossip.Gossip})
    processes = skein.run(scenario, pilots={"gossip": gossip.Gossip}, runtime="processes", out=tmp_path / "run")
    assert inline.digest == processes.digest == digest(app(tmp_path, "run", scenario, "--json"))
    loaded = skein.load(tmp_path / "run")
    assert loaded.outcome == "timeout" and loaded.manifest["seed"] == 5
    assert len(loaded.trace["x_m"]) > 4 and any(event["event"] == "end" for event in loaded.events)
    assert loaded.summary["metrics_own"]["heard"]["max"] == 3


def test_a_run_has_the_messages_of_its_pilots():
    said = []

    class Talks(skein.Pilot):
        def __init__(self, birth):
            self.drone = birth.drone

        def step(self, senses, inbox, out):
            if senses.tick % 10 == self.drone:
                data = bytes([self.drone]) * (self.drone + 1)
                out.say(f"talk/{self.drone % 2}", data)
                said.append((self.drone, f"talk/{self.drone % 2}", data))
            return skein.Acceleration(0.0, 0.0)

    run = skein.run(HEAD, pilots={"talks": Talks}, set={"time.timeout_s": 0.5})
    messages = run.messages
    heard = sorted(zip(messages["source"], messages["topic"], messages["data"], strict=True))
    assert len(said) >= 8 and heard == sorted(said)
    times = list(messages["t_s"])
    assert times == sorted(times) and 0 <= times[0] and times[-1] <= 0.5


STATE = {"type": "object", "properties": {"mode": {"type": "integer"}}}


class States(skein.Pilot):
    """Says a JSON object in each tick, and once something else."""

    def __init__(self, birth):
        self.drone = birth.drone

    def step(self, senses, inbox, out):
        data = {"mode": self.drone, "tick": senses.tick}
        out.say("fleet/state", b"no object" if senses.tick == 3 else json.dumps(data).encode())
        return skein.Acceleration(0.0, 0.0)


def test_a_topic_with_a_schema_has_a_channel_for_each_drone():
    short = {"time.timeout_s": 0.2}
    run = skein.run(HEAD, pilots={"states": States}, set=short, json_topics={"fleet/state": STATE})
    assert run.manifest["facts"]["topics"] == [{"topic": "fleet/state", "schema": STATE}]
    recording = (run.folder / "run.mcap").read_bytes()
    assert b"/pilots/fleet/state/3" in recording and b"pilots.fleet/state" in recording
    messages = run.messages
    said = list(zip(messages["source"], messages["topic"], messages["data"], strict=True))
    assert {topic for _, topic, _ in said} == {"fleet/state"}
    objects = [(source, json.loads(data)) for source, _, data in said if data != b"no object"]
    assert len(said) - len(objects) == 4 and len(objects) >= 20
    assert all(source == found["mode"] for source, found in objects)
    # The schema is about the recording alone.
    assert run.digest == skein.run(HEAD, pilots={"states": States}, set=short).digest


def test_an_application_gives_its_topics_schemas_and_a_wrong_one_is_refused(tmp_path):
    scenario = tmp_path / "states.toml"
    scenario.write_text(HEAD + '[[pilot]]\nname = "states"\n')
    script = tmp_path / "states.py"
    words = ["run", scenario, "--set", "time.timeout_s=0.2", "--force", "--out", "run"]

    def fly(topics, check):
        script.write_text(
            f"import sys\nsys.path.insert(0, {str(HERE)!r})\nimport skein\nfrom test_pilots import STATE, States\n"
            f'if __name__ == "__main__":\n    skein.main(states=States, json_topics={topics})\n'
        )
        return app(tmp_path, *words, script=script, check=check).stderr

    fly('{"fleet/state": STATE}', 1)
    assert skein.load(tmp_path / "run").manifest["facts"]["topics"][0]["schema"] == STATE
    assert "topic fleet: the schema is no JSON" in fly('{"fleet": "{"}', 2)
    assert '"no name"' in fly('{"no name": STATE}', 2)
    with pytest.raises(skein.Error, match="no JSON"):
        skein.run(HEAD, pilots={"states": States}, json_topics={"fleet": "{"})
    with pytest.raises(TypeError, match="json_topics"):
        skein.run(HEAD, pilots={"states": States}, json_topics={"fleet": 3})


def test_an_obstacle_has_a_floor_and_a_top():
    seen = []

    class Looks(skein.Pilot):
        def step(self, senses, inbox, out):
            seen.extend((near.obstacle, near.floor_m, near.top_m) for near in senses.obstacles)
            return skein.Acceleration(0.0, 0.0)

    obstacles = [
        {"shape": "circle", "centre_m": [80, 30], "radius_m": 5, "floor_m": 2.5, "top_m": 120.0},
        {"shape": "circle", "centre_m": [80, -60], "radius_m": 5},
    ]
    near = {"obstacle": obstacles, "sensors.detection_range_m": 1000.0, "time.timeout_s": 0.1}
    skein.run(HEAD, pilots={"looks": Looks}, set=near, record=False)
    assert set(seen) == {(0, 2.5, 120.0), (1, -math.inf, math.inf)}


def test_a_forked_process_never_flies(tmp_path, scenario):
    path = tmp_path / "fails.toml"
    path.write_text(GOSSIP + '[[pilot]]\nname = "fails"\ndrones = [2]\nparams = { how = "fork" }\n')
    for runtime in ("inline", "processes"):
        done = app(tmp_path, "run", path, "--json", "--no-record", "--runtime", runtime, "--out", runtime)
        assert "which the pilot of drone 2 forked, is ended" in done.stderr
        summary = json.loads(done.stdout)
        assert summary["failures"] == [] and summary["sim_s"] == pytest.approx(2.0, abs=0.05)


def test_a_single_pilot_flies_a_scenario_without_pilots_and_keys_can_be_set():
    run = skein.run(HEAD, pilots={"gossip": gossip.Gossip}, set={"formation.drones": 2, "pilot.0.params": {"k": 0.1}}, seed=9)
    assert run.summary["drones"] == 2 and run.summary["seed"] == 9
    assert run.summary["pilots"][0]["params"] == {"k": 0.1}


def test_classes_of_the_main_module_fly_by_processes(tmp_path, scenario):
    script = tmp_path / "script.py"
    script.write_text(
        f"""
import sys
sys.path.insert(0, {str(HERE)!r})
import gossip, skein
class Mine(gossip.Gossip):
    pass
if __name__ == "__main__":
    runs = [skein.run({str(scenario)!r}, pilots={{"gossip": Mine}}, runtime=r) for r in ("inline", "processes")]
    print(runs[0].digest == runs[1].digest)
"""
    )
    assert app(tmp_path, script=script, check=0).stdout == "True\n"


def test_a_class_that_no_other_process_can_import_is_refused(scenario):
    class Local(gossip.Gossip):
        pass

    assert skein.run(scenario, pilots={"gossip": Local}).outcome == "timeout"
    with pytest.raises(ValueError, match="inline"):
        skein.run(scenario, pilots={"gossip": Local}, runtime="processes")


def test_wrong_scenarios_are_errors_with_their_place(tmp_path, scenario):
    with pytest.raises(skein.Error, match="params.k: expected a number") as refused:
        skein.run(scenario, pilots={"gossip": gossip.Gossip}, set={"pilot.0.params.k": "much"})
    assert refused.value.code == 2
    with pytest.raises(skein.Error, match="gossip.toml:.*did you mean"):
        skein.run(scenario, pilots={"gosip": gossip.Gossip})
    assert app(tmp_path, "run", scenario, "--set", "pilot.0.params.k=true").returncode == 2


@pytest.mark.parametrize("runtime", ["inline", "processes"])
def test_ctrl_c_ends_a_run_cleanly(tmp_path, scenario, runtime):
    words = ["run", scenario, "--set", "time.timeout_s=10000", "--runtime", runtime, "--no-record", "--out", "run"]
    flying = subprocess.Popen([sys.executable, APP, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + 30
    while not (tmp_path / "run" / "processes.json").exists() and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(0.3)
    os.kill(flying.pid, signal.SIGINT)
    _, said = flying.communicate(timeout=30)
    assert flying.returncode == 130, said.decode()
    assert b"Traceback" not in said
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["outcome"] == "aborted"


def test_what_is_lent_for_a_step_cannot_be_used_after_it():
    kept = []

    class Keeps(skein.Pilot):
        def step(self, senses, inbox, out):
            kept[:] = [senses, inbox, out, senses.position_m, senses.neighbours, senses.neighbours_array()]
            out.mark("here", senses.position_m)
            out.line("up", (0, 0, 0), [0, 0, 1])
            out.done()
            assert re.match(r"Senses\(now_s=", repr(senses))
            return skein.Velocity(1.0, 0.0)

    assert skein.run(HEAD, pilots={"keeps": Keeps}, set={"time.timeout_s": 0.1}, record=False).summary["failures"] == []
    senses, inbox, out, position, neighbours, array = kept
    for use in (lambda: senses.now_s, lambda: inbox.all(), lambda: out.say("a", b""), lambda: out.metric("a", 1.0)):
        with pytest.raises(RuntimeError, match="during its step only"):
            use()
    assert len(position) == 3 and len(neighbours) == len(array)


def test_a_sweep_flies_python_pilots(tmp_path, scenario):
    experiment = tmp_path / "loss.toml"
    experiment.write_text(
        'name = "loss"\nscenario = "gossip.toml"\nseeds = 2\nmetrics = ["mission_s"]\n[grid]\nradio.loss = [0.0, 0.5]\n'
    )
    sweep = skein.sweep(experiment, pilots={"gossip": gossip.Gossip}, out=tmp_path / "sweep", jobs=2)
    assert list(sweep.results["radio.loss"]) == [0.0, 0.0, 0.5, 0.5]


def test_a_sweep_gives_texts_with_commas(tmp_path):
    experiment = tmp_path / "short.toml"
    scenario = Path(__file__).parents[2] / "scenarios" / "paper" / "s2-right.toml"
    experiment.write_text(f'name = "short"\nscenario = {json.dumps(str(scenario))}\nseeds = 1\n[grid]\ntime.timeout_s = [1.0]\n')
    results = skein.sweep(experiment, out=tmp_path / "sweep", jobs=1).results
    assert list(results["outcome"]) == ["timeout"]
    assert "," in results["reason"][0] and "drone" in results["reason"][0]


def test_the_example_is_the_same_in_both_runtimes(tmp_path):
    path = tmp_path / "field.toml"
    path.write_text(FIELD)
    words = ["run", path, "--json", "--no-record", "--seed", 2]
    runs = [app(tmp_path, *words, "--runtime", r, script=BOIDS / "boids.py", check=0) for r in ("inline", "processes")]
    assert digest(runs[0]) == digest(runs[1])
    assert json.loads(runs[1].stdout)["violations"] == []


def test_the_package_is_typed_and_documented():
    assert (Path(skein.__file__).parent / "py.typed").exists()
    for name in set(skein.__all__) - {"Env", "ParallelEnv", "VectorEnv", "parallel_env", "vector_env", "__version__"}:
        assert getattr(skein, name).__doc__, name
