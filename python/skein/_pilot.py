"""What a pilot inherits."""

from __future__ import annotations

from ._skein import Acceleration, Birth, Inbox, Out, Senses, Velocity


class Pilot:
    """The software that flies one drone.

    It should be deterministic: equal senses and messages give equal commands and messages. Then a mission has the same digest
    in every runtime and in every repetition. Time is ``senses.now_s``; randomness comes from ``birth.seed``, ``birth.drone`` and
    ``birth.incarnation``.

    An exception is the end of its drone, and of no other one: the traceback is in ``failures/drone-N.txt`` of the run's folder,
    and the reason is in ``failures`` of the summary.
    """

    def __init__(self, birth: Birth) -> None:
        """Makes the pilot of ``birth.drone``. A restarted drone gets a new pilot that knows nothing but ``birth``."""

    def step(self, senses: Senses, inbox: Inbox, out: Out) -> Acceleration | Velocity:
        """Steps one tick.

        ``senses`` is what the drone senses now, ``inbox`` what it heard since the step before, and ``out`` takes what it has to
        say. All three can be used during the step only.
        """
        raise NotImplementedError(f"{type(self).__name__} has no method step(self, senses, inbox, out)")


class ParamError(ValueError):
    """A parameter that a pilot cannot use. Raised in ``__init__``, it refuses the scenario before anything starts, with the
    place of the key in the file::

        if not k > 0:
            raise skein.ParamError("k", f"expected a positive number, found {k}")
    """

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(f"params.{key}: {problem}")
        self.key = key
        self.problem = problem
