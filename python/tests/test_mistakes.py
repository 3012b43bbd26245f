"""What a pilot does wrong is the end of its own drone."""

from __future__ import annotations

import json

import pytest
from test_pilots import GOSSIP, app


@pytest.mark.parametrize("runtime", ["inline", "processes"])
@pytest.mark.parametrize("how", ["raise", "nan", "none"])
def test_a_mistake_is_the_end_of_its_drone_alone(tmp_path, how, runtime):
    path = tmp_path / "fails.toml"
    path.write_text(GOSSIP + f'[[pilot]]\nname = "fails"\ndrones = [2]\nparams = {{ how = "{how}" }}\n')
    done = app(tmp_path, "run", path, "--json", "--runtime", runtime, "--out", "run")
    summary = json.loads(done.stdout)
    (failure,) = summary["failures"]
    assert failure["drone"] == 2 and failure["pilot"] == "fails"
    assert failure["t_s"] == pytest.approx(0.5, abs=0.05)
    if how == "raise":
        assert "RuntimeError: no more (gossip.py, line" in failure["reason"]
        assert "raise RuntimeError" in (tmp_path / "run" / "failures" / "drone-2.txt").read_text()
    assert summary["sim_s"] == pytest.approx(2.0, abs=0.05)


def test_an_exit_is_a_failure_too(tmp_path):
    path = tmp_path / "fails.toml"
    path.write_text(GOSSIP + '[[pilot]]\nname = "fails"\ndrones = [2]\nparams = { how = "exit" }\n')
    summary = json.loads(app(tmp_path, "run", path, "--json").stdout)
    assert [failure["drone"] for failure in summary["failures"]] == [2]
