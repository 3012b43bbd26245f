"""The machinery of the package."""

from collections.abc import Callable, Sequence
from typing import Any, final

from numpy.typing import NDArray

__version__: str

Vector = tuple[float, float, float]

@final
class Birth:
    """What a pilot is made from. A restarted drone gets a new pilot that knows nothing but this."""

    @property
    def drone(self) -> int:
        """Number of the drone, from 0."""
    @property
    def drones(self) -> int:
        """Number of drones in the swarm."""
    @property
    def incarnation(self) -> int:
        """Counts the starts of this drone, from 1. A restart makes it one more."""
    @property
    def start_s(self) -> float:
        """Simulated time of the pilot's first step, s."""
    @property
    def dt_s(self) -> float:
        """Length of a tick, s."""
    @property
    def seed(self) -> int:
        """Seed of the mission. A pilot that needs randomness derives it from this, its drone and its incarnation."""
    @property
    def pilot(self) -> str:
        """Name of the pilot."""
    @property
    def params(self) -> dict[str, Any]:
        """The table ``params`` of the pilot in the scenario."""
    @property
    def scenario(self) -> dict[str, Any]:
        """The whole scenario as resolved, with all defaults."""

@final
class Senses:
    """What a drone senses in a tick, and when. World frame: x east, y north, z up."""

    @property
    def now_s(self) -> float:
        """Simulated time at which the tick begins, s."""
    @property
    def tick(self) -> int:
        """Number of the tick."""
    @property
    def position_m(self) -> Vector:
        """The drone's position as its sensors report it, m."""
    @property
    def velocity_mps(self) -> Vector:
        """The drone's velocity as its sensors report it, m/s."""
    @property
    def extra_reaction_s(self) -> float:
        """Time that faults add to the drone's reaction time, s."""
    @property
    def neighbours(self) -> list[Neighbour]:
        """The drones within ranging distance."""
    @property
    def obstacles(self) -> list[Obstacle]:
        """The obstacles that are at least partly in detection range."""
    def neighbours_array(self) -> NDArray[Any]:
        """The neighbours as a numpy array with the fields ``position_m``, ``velocity_mps`` and ``drone``, for arithmetic over all
        of them. It may be kept after the step."""

@final
class Neighbour:
    """Another drone within ranging distance."""

    @property
    def drone(self) -> int:
        """Its number."""
    @property
    def position_m(self) -> Vector:
        """Its position relative to the sensing drone, m."""
    @property
    def velocity_mps(self) -> Vector:
        """Its velocity relative to the sensing drone, m/s."""

@final
class Obstacle:
    """An obstacle that is at least partly in detection range."""

    @property
    def obstacle(self) -> int:
        """Its number."""
    @property
    def nearest_m(self) -> Vector:
        """Point of its surface that is nearest to the drone, world frame, m."""
    @property
    def distance_m(self) -> float:
        """Distance from the drone to that point, m; negative if the drone is inside the obstacle."""
    @property
    def outline_m(self) -> tuple[tuple[float, float], ...]:
        """The corners of its outline seen from above, counterclockwise, world frame, m; the centre of a circle."""
    @property
    def radius_m(self) -> float:
        """How far it reaches beyond its outline, m: the radius of a circle, whose outline is its centre."""
    @property
    def floor_m(self) -> float:
        """Altitude of its lower face, m; minus infinity if it has none."""
    @property
    def top_m(self) -> float:
        """Altitude of its upper face, m; infinity if it has none."""

@final
class Inbox:
    """The messages that a drone received since its step before, in the order of their arrival."""

    def of(self, topic: str) -> list[Message]:
        """The messages of a topic."""
    def all(self) -> list[Message]:
        """The messages of all topics that pilots define."""

@final
class Message:
    """A message received by radio."""

    @property
    def source(self) -> int:
        """Number of the drone that sent it."""
    @property
    def topic(self) -> str:
        """Its topic."""
    @property
    def data(self) -> bytes:
        """What it says."""

@final
class Out:
    """Takes what a pilot says in a tick."""

    def say(self, topic: str, data: Any) -> None:
        """Broadcasts bytes under a topic: 1 to 31 characters from a-z 0-9 _ - . /, and at most 272 bytes. ``data`` is bytes, a
        bytearray, a str (as UTF-8), or anything that gives its bytes, such as a numpy array."""
    def metric(self, name: str, value: float) -> None:
        """Reports a figure. It is recorded, and not sent to other drones. The name has 1 to 31 characters from
        a-z A-Z 0-9 _ - . /; a value that is not finite is not recorded. If one name comes twice in a tick, the last value
        counts."""
    def mark(self, label: str, point_m: Sequence[float]) -> None:
        """Shows a point (world frame, m) in the views of the swarm until the next tick."""
    def line(self, label: str, from_m: Sequence[float], to_m: Sequence[float]) -> None:
        """Shows a line (world frame, m) in the views of the swarm until the next tick."""
    def done(self, done: bool = True) -> None:
        """Says whether the mission is done, as far as this drone is concerned. It holds for this tick. With
        ``mission.end = "pilots"``, the mission ends once all living drones say so in the same tick."""

@final
class Acceleration:
    """Accelerate: world frame (x east, y north, z up), m/s². The drone does at most its greatest acceleration in this direction."""

    def __init__(self, x: float, y: float, z: float = 0.0) -> None: ...
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def z(self) -> float: ...

@final
class Velocity:
    """Reach this velocity and keep it: world frame (x east, y north, z up), m/s. An inner loop of the runtime holds it: in each
    tick it accelerates by the difference to the sensed velocity times ``guidance.velocity_gain_per_s``."""

    def __init__(self, x: float, y: float, z: float = 0.0) -> None: ...
    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def z(self) -> float: ...

@final
class Swarm:
    """A swarm in this process that is steered by arrays. ``skein.Swarm`` wraps it."""

    def __init__(
        self,
        text: str,
        name: str,
        overrides: list[tuple[str, str]],
        *,
        neighbours: int = 6,
        obstacles: int = 2,
        peers: int = 4,
        message: int = 0,
    ) -> None: ...
    def reset(self, seed: int | None = None) -> None: ...
    def step(self) -> str | None: ...
    def arrays(self) -> dict[str, NDArray[Any]]: ...
    @property
    def outcome(self) -> str | None: ...
    @property
    def drones(self) -> int: ...
    @property
    def dt_s(self) -> float: ...
    @property
    def now_s(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def digest(self) -> str: ...
    @property
    def min_separation_m(self) -> float: ...
    @property
    def violations(self) -> int: ...
    @property
    def scenario(self) -> dict[str, Any]: ...

def answer(
    arguments: list[str],
    program: list[str],
    pilots: list[tuple[str, Callable[[Birth], Any]]],
    topics: list[tuple[str, str]],
) -> int:
    """Does what the arguments say and returns the exit code. ``topics``: names of topics, and their JSON schemas as text."""

def messages(folder: str) -> list[tuple[float, int, str, bytes]]:
    """What pilots said under topics of their own, in the recording of a run: time, s, sender, topic, bytes."""
