"""The program of a process when ``skein.run`` flies by processes: it imports the caller's classes again.

As in multiprocessing's spawn, the main module of the caller is run under another name, so that what stands under
``if __name__ == "__main__"`` is not done again.
"""

from __future__ import annotations

import importlib
import json
import operator
import runpy
import sys
from typing import Any

#: The name under which the caller's main module is run.
MAIN = "__skein_main__"


def pilots_of(spec: dict[str, Any], script: str | None) -> dict[str, Any]:
    """The classes that a specification names. ``script``: the caller's main module."""
    main: dict[str, Any] | None = None
    pilots = {}
    for name, (module, path) in spec["pilots"].items():
        if module == "__main__":
            if main is None:
                main = runpy.run_path(str(script), run_name=MAIN)
            first, _, rest = path.partition(".")
            made = main[first]
            pilots[name] = operator.attrgetter(rest)(made) if rest else made
        else:
            pilots[name] = operator.attrgetter(path)(importlib.import_module(module))
    return pilots


def program(pilots: dict[str, Any]) -> list[str]:
    """The words that start a program with these classes. Raises ValueError if another process cannot import one of them."""
    spec: dict[str, Any] = {"path": sys.path, "pilots": {}}
    files = []
    for name, made in pilots.items():
        module, path = getattr(made, "__module__", None), getattr(made, "__qualname__", "<locals>")
        file = getattr(sys.modules.get(module or ""), "__file__", None)
        if file is None or "<" in path:
            raise ValueError(
                f"the pilot {name!r} flies by processes only if it is a class of a script or module: other processes "
                "import it. In a notebook, move it to a file, or fly with runtime='inline'."
            )
        spec["pilots"][name] = [module, path]
        files.append(file)
    script = getattr(sys.modules["__main__"], "__file__", None)
    words = [sys.executable, "-m", "skein._role", json.dumps(spec)]
    # The program's hash is that of these files.
    return words + [str(len(files)), str(script or ""), *files]
