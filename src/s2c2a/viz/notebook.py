"""Pictures of arms and runs in notebooks, where a cell ends with one.

`import s2c2a` imports this module where IPython is loaded.
"""

from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from IPython import get_ipython

from s2c2a import arm, episodes, viz
from s2c2a.errors import S2C2AError

DRAWN = {"s2c2a.arm.spec": "ArmSpec", "s2c2a.episodes.episode": "Episode"}
"""Classes by module, which IPython finds once they are imported."""


def picture(value: "arm.ArmSpec | episodes.Episode") -> bytes | None:
    """The figure of an arm or a run (PNG); None, so that text is shown, without states."""
    with TemporaryDirectory() as folder, suppress(S2C2AError):
        path = Path(folder) / "figure.png"
        if isinstance(value, episodes.Episode):
            viz.run_figure([viz.Trace(value, "run")], value.arm, path)
        else:
            viz.arm_figure(value, path)
        return path.read_bytes()
    return None


shell = get_ipython()
if shell is not None:
    pictures = shell.display_formatter.formatters["image/png"]
    for module, name in DRAWN.items():
        pictures.for_type_by_name(module, name, picture)
