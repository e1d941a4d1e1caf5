import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from s2c2a.arm import arm_from_toml
from s2c2a.cli.export import export
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import S2C2AError

RECORDING = Path(__file__).parents[1] / "fixtures" / "twin.episodes"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "two.episodes"
    episodes, options = load_episodes(RECORDING)
    save_episodes(episodes[:2], path, options)
    return path


def exported(recording, out):
    """Episode 2 and the text of a written file."""
    export(recording, out)
    if out.suffix == ".npz":
        content = np.load(out)
        prefix = "episode2."
        second = {
            name.removeprefix(prefix): content[name]
            for name in content
            if name.startswith(prefix)
        }
    else:
        content = loadmat(out, simplify_cells=True)
        second = content["episode2"]
    return second, str(content["arm"]), str(content["options"])


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_exported_episodes_read_back_equal(recording, tmp_path, ending):
    second, arm, options = exported(recording, tmp_path / f"two.{ending}")
    episodes, known_options = load_episodes(recording)
    assert arm_from_toml(arm, "arm") == episodes[1].arm
    assert json.loads(options) == known_options
    assert json.loads(str(second.pop("options"))) == dict(episodes[1].options)
    assert len(second) == len(episodes[1].columns)
    for name, values in episodes[1].columns.items():
        array = second[name.replace(".", "_")]
        np.testing.assert_array_equal(array, values)


def test_another_ending_is_refused(recording, tmp_path):
    with pytest.raises(S2C2AError, match=r"none of \.npz, \.mat"):
        export(recording, tmp_path / "two.csv")
