"""Missions and sweeps from notebooks and scripts."""

from __future__ import annotations

import csv
import functools
import json
import os
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from . import _child, _skein
from ._app import Make, Schema, answer

#: A scenario: the path of its file, its text as TOML, or its keys.
Scenario = str | os.PathLike[str] | Mapping[str, Any]


class Run:
    """A run's folder, read when it is asked for.

    >>> run = skein.run("scenarios/paper/s2-right.toml", runtime="inline")
    >>> run.summary["outcome"]
    'reached'
    """

    def __init__(self, folder: str | os.PathLike[str], kept: Any = None) -> None:
        self.folder = Path(folder)
        # A temporary folder lives as long as the run.
        self._kept = kept

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json: the result of the run."""
        return _object(self.folder / "summary.json")

    @functools.cached_property
    def manifest(self) -> dict[str, Any]:
        """manifest.json: what was flown."""
        return _object(self.folder / "manifest.json")

    @functools.cached_property
    def events(self) -> list[dict[str, Any]]:
        """events.jsonl: what happened, in its order, each with ``t_s``."""
        with open(self.folder / "events.jsonl", encoding="utf-8") as lines:
            return [json.loads(line) for line in lines if line.strip()]

    @functools.cached_property
    def trace(self) -> Any:
        """trace.csv: one row per drone and sample, as a pandas DataFrame, or a numpy structured array without pandas."""
        return _table(self.folder / "trace.csv")

    @functools.cached_property
    def messages(self) -> Any:
        """What pilots said under topics of their own: ``t_s``, ``source``, ``topic``, ``data``. A pandas DataFrame, or a numpy
        structured array without pandas."""
        rows = _skein.messages(os.fspath(self.folder))
        columns = ["t_s", "source", "topic", "data"]
        try:
            import pandas
        except ImportError:
            import numpy

            return numpy.array(rows, dtype=[("t_s", "f8"), ("source", "u4"), ("topic", "O"), ("data", "O")])
        return pandas.DataFrame(rows, columns=columns)

    @property
    def outcome(self) -> str:
        """"reached", "timeout", "stuck", "unsafe" or "aborted"."""
        return str(self.summary["outcome"])

    @property
    def digest(self) -> str:
        """The digest over every drone's state and every delivered message in every tick."""
        return str(self.summary["digest"])

    def __repr__(self) -> str:
        return f"<skein.Run {self.folder}: {self.outcome}>"


class Sweep:
    """A finished sweep's folder."""

    def __init__(self, folder: str | os.PathLike[str], kept: Any = None) -> None:
        self.folder = Path(folder)
        self._kept = kept

    @functools.cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json: the groups of runs with their means and intervals."""
        return _object(self.folder / "summary.json")

    @functools.cached_property
    def results(self) -> Any:
        """runs.csv: one row per run, as a pandas DataFrame, or a numpy structured array without pandas."""
        return _table(self.folder / "runs.csv")

    def __repr__(self) -> str:
        return f"<skein.Sweep {self.folder}>"


def run(
    scenario: Scenario,
    *,
    pilots: Mapping[str, Make] | None = None,
    set: Mapping[str, Any] | None = None,
    runtime: Literal["inline", "processes"] = "inline",
    seed: int | None = None,
    out: str | os.PathLike[str] | None = None,
    strategy: str | None = None,
    clock: str | None = None,
    record: bool = True,
    json_topics: Mapping[str, Schema] | None = None,
) -> Run:
    """Flies one mission and gives its result.

    ``scenario``: a file, TOML text of several lines, or a dict. ``pilots``: classes by the names that the scenario has in
    ``[[pilot]]``; a single one flies all drones of a scenario without such tables. ``set``: keys to change, such as
    ``{"radio.loss": 0.2}``. ``out``: folder of the run; the default is a temporary one, which lives as long as the result.
    ``runtime="processes"`` gives each drone a process; classes must then be importable, as with multiprocessing.
    ``json_topics``: JSON schemas of topics under which pilots say JSON objects, as in ``skein.main``.

    Raises ``skein.Error`` if the mission could not be flown. A goal that was not reached, or a broken invariant, is no error: see
    ``run.outcome``.
    """
    pilots = dict(pilots or {})
    kept = tempfile.TemporaryDirectory(prefix="skein-") if out is None else None
    folder = os.path.join(kept.name, "run") if kept else os.fspath(out)  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory(prefix="skein-") as scratch:
        path = _file(scenario, scratch)
        args = ["run", path, "--runtime", runtime, "--quiet", "--out", folder]
        args += _changes(set, seed)
        if len(pilots) == 1 and not _names_pilots(path):
            args += ["--set", f"pilot.0.name={_toml(next(iter(pilots)))}"]
        args += ["--strategy", strategy] if strategy is not None else []
        args += ["--clock", clock] if clock is not None else []
        args += [] if record else ["--no-record"]
        answer(args, _program(pilots, runtime == "processes"), pilots, json_topics)
    return Run(folder, kept)


def sweep(
    experiment: str | os.PathLike[str],
    *,
    pilots: Mapping[str, Make] | None = None,
    set: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    jobs: int | None = None,
) -> Sweep:
    """Flies the runs of an experiment that ``out`` does not have yet, and gives the results of all.

    The runs fly in processes, side by side: classes of ``pilots`` must be importable, as with multiprocessing.
    """
    pilots = dict(pilots or {})
    kept = tempfile.TemporaryDirectory(prefix="skein-") if out is None else None
    folder = os.path.join(kept.name, "sweep") if kept else os.fspath(out)  # type: ignore[arg-type]
    args = ["sweep", os.fspath(experiment), "--quiet", "--out", folder, *_changes(set, None)]
    args += ["--jobs", str(jobs)] if jobs is not None else []
    answer(args, _program(pilots, True), pilots)
    return Sweep(folder, kept)


def load(folder: str | os.PathLike[str]) -> Run:
    """A run that was flown before."""
    path = Path(folder)
    if not (path / "summary.json").is_file():
        raise FileNotFoundError(f"{path}: expected the folder of a run, with a summary.json")
    return Run(path)


def _program(pilots: Mapping[str, Make], processes: bool) -> list[str]:
    try:
        return _child.program(dict(pilots))
    except ValueError:
        if processes:
            raise
        # Nothing is started inline: the words only name the program.
        return _child.program({})


def _file(scenario: Scenario, scratch: str) -> str:
    """The path of a scenario's file, which is written if there is none."""
    if isinstance(scenario, Mapping):
        text = "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in scenario.items())
    elif isinstance(scenario, str) and "\n" in scenario:
        text = scenario
    else:
        return os.fspath(scenario)
    path = os.path.join(scratch, "scenario.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def _names_pilots(path: str) -> bool:
    try:
        with open(path, encoding="utf-8") as file:
            return re.search(r"^\s*(\[\[\s*\"?pilot\"?\s*\]\]|\"?pilot\"?\s*=)", file.read(), re.MULTILINE) is not None
    except (OSError, UnicodeDecodeError):
        # Skein says what is wrong with the file.
        return True


def _changes(set: Mapping[str, Any] | None, seed: int | None) -> list[str]:
    args = []
    for key, value in (set or {}).items():
        args += ["--set", f"{key}={_toml(value)}"]
    return args + (["--seed", str(seed)] if seed is not None else [])


def _toml(value: Any) -> str:
    """A value as TOML in one line."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {_toml(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    raise TypeError(f"{value!r}: expected a number, a text, a bool, a list or a dict")


def _object(path: Path) -> dict[str, Any]:
    with open(path, encoding="utf-8") as file:
        found: dict[str, Any] = json.load(file)
        return found


def _table(path: Path) -> Any:
    try:
        import pandas
    except ImportError:
        import numpy

        # numpy knows no quotes, and the texts of a cell have commas: cells are joined again with a character that no text has.
        with open(path, encoding="utf-8", newline="") as file:
            lines = ["\x1f".join(cells).replace("\n", " ") for cells in csv.reader(file)]
        table = numpy.genfromtxt(
            lines, delimiter="\x1f", comments=None, names=True, deletechars="", dtype=None, encoding="utf-8"
        )
        return numpy.atleast_1d(table)
    return pandas.read_csv(path)
