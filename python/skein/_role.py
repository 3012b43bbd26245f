"""The program that ``skein.run`` starts for the world and for each drone."""

import json
import sys

from skein import _app, _child


def main() -> None:
    """Plays the role in the arguments, with the classes that the first of them name."""
    spec = json.loads(sys.argv[1])
    own, role = sys.argv[1 : 4 + int(sys.argv[2])], sys.argv[4 + int(sys.argv[2]) :]
    sys.path[:] = spec["path"]
    pilots = _child.pilots_of(spec, sys.argv[3])
    sys.exit(_app.command(role, [sys.executable, "-m", "skein._role", *own], pilots))


if __name__ == "__main__":
    main()
