"""The application: all commands of Skein, with the caller's pilots."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NoReturn

from . import _skein

#: A class, or any function that makes a pilot of a birth.
Make = Callable[[_skein.Birth], Any]

#: A JSON schema: an object, or its text.
Schema = Mapping[str, Any] | str


class Error(RuntimeError):
    """A command that could not be carried out. ``code`` is the exit code of ``skein``: 2 for a wrong scenario or wrong usage, 3
    where the environment failed."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def main(*, json_topics: Mapping[str, Schema] | None = None, **pilots: Make) -> NoReturn:
    """Makes the script an application that answers to all commands of Skein, and exits with their exit codes.

    Each keyword is the name of a pilot, as a scenario names it in ``[[pilot]]``, and its value the class that flies it::

        if __name__ == "__main__":
            skein.main(boids=Boid)

    Then ``python boids.py run scenario.toml`` flies the scenario. The processes of its drones are started from this script.

    ``json_topics``: the JSON schemas of topics under which pilots say JSON objects. ``run.mcap`` then has a channel
    ``/pilots/TOPIC/DRONE`` for each drone, with the schema, which Foxglove can plot::

        skein.main(boids=Boid, json_topics={"state": {"type": "object", "properties": {"x_m": {"type": "number"}}}})
    """
    script = os.path.abspath(sys.argv[0])
    sys.exit(command(sys.argv[1:], [sys.executable, script], pilots, json_topics))


def command(
    args: Sequence[str],
    program: Sequence[str],
    pilots: Mapping[str, Make],
    json_topics: Mapping[str, Schema] | None = None,
) -> int:
    """Carries a command out in this process and returns its exit code."""
    topics = [(topic, _text(topic, schema)) for topic, schema in (json_topics or {}).items()]
    # What pilots print is no result: it goes to stderr.
    with _signals_of_skein(), contextlib.redirect_stdout(sys.stderr):
        try:
            return _skein.answer(list(args), list(program), list(pilots.items()), topics)
        finally:
            if args[:1] == ["run"]:
                # Set by the command, for its pilots and processes.
                os.environ.pop("SKEIN_RUN_DIR", None)


def _text(topic: str, schema: Schema) -> str:
    if isinstance(schema, str):
        return schema
    if not isinstance(schema, Mapping):
        raise TypeError(f"json_topics[{topic!r}]: expected a JSON schema as a dict or as text, found {schema!r}")
    return json.dumps(dict(schema))


def answer(
    args: Sequence[str],
    program: Sequence[str],
    pilots: Mapping[str, Make],
    json_topics: Mapping[str, Schema] | None = None,
) -> int:
    """Carries a command out in this process, as a function: what it says on stderr becomes an exception, or goes to Python's stderr.

    Raises ``Error`` for the exit codes 2 and 3, and ``KeyboardInterrupt`` after Ctrl-C.
    """
    with tempfile.TemporaryFile() as said:
        with _stderr_to(said.fileno()):
            code = command(args, program, pilots, json_topics)
        said.seek(0)
        words = said.read().decode(errors="replace").strip()
    if code in (2, 3):
        raise Error(words or f"skein {args[0]} ended with exit code {code}", code)
    if words:
        print(words, file=sys.stderr)
    if code > 128:
        raise KeyboardInterrupt
    return code


@contextlib.contextmanager
def _stderr_to(descriptor: int) -> Iterator[None]:
    """Lets everything that this process and its children say on stderr go elsewhere."""
    sys.stderr.flush()
    before = os.dup(2)
    os.dup2(descriptor, 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)


@contextlib.contextmanager
def _signals_of_skein() -> Iterator[None]:
    """Ctrl-C ends a run cleanly instead of raising an exception in some pilot's step. Afterwards it is Python's again."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
