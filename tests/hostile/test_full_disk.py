"""Full disks: no silent loss, and collecting resumes after the last whole episode."""

import resource

import matplotlib.pyplot as plt
import numpy as np
import pytest

from s2c2a.data import load_recording
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.files.text import write_atomically
from s2c2a.viz.charts import save_figure


@pytest.fixture
def limit_file_size():
    """Limit the size of files, so that a write fails as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(size: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))

    yield limit
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def assert_same(one, two) -> None:
    """Two files of episodes agree in everything except computation times."""
    first, second = (load_episodes(path) for path in (one, two))
    assert first[1] == second[1]
    for mine, others in zip(first[0], second[0], strict=True):
        assert mine.columns.keys() == others.columns.keys()
        for name in mine.columns.keys() - {"tick_time"}:
            np.testing.assert_array_equal(mine[name], others[name], err_msg=name)


@pytest.mark.parametrize("part", [0.3, 0.5, 0.999])
def test_collecting_on_a_full_disk_keeps_whole_episodes_and_resumes(
    gather, limit_file_size, tmp_path, part
):
    gather("whole.episodes")
    room = int(part * (tmp_path / "whole.episodes").stat().st_size)
    limit_file_size(room)
    with pytest.raises(
        RecordingError, match=r"could not be written.*whole ones are kept.*--resume"
    ):
        gather("full.episodes")
    kept = load_recording(tmp_path / "full.episodes")
    assert 1 <= len(kept.episodes) < 5
    with pytest.raises(RecordingError, match=rf"{len(kept.episodes)} of 5 episodes"):
        kept.check_complete()
    with pytest.raises(RecordingError, match="could not be written"):
        gather("full.episodes", resume=True)
    limit_file_size(10_000_000)
    gather("full.episodes", resume=True)
    assert_same(tmp_path / "full.episodes", tmp_path / "whole.episodes")


def test_a_failed_write_leaves_no_file(gather, limit_file_size, recording, tmp_path):
    (tmp_path / "there.json").write_text("before")
    figure = plt.figure()
    limit_file_size(1000)
    with pytest.raises(S2C2AError, match="cannot write"):
        write_atomically("x" * 5000, tmp_path / "there.json")
    with pytest.raises(RecordingError, match="cannot write"):
        save_episodes(recording.episodes, tmp_path / "some.episodes")
    with pytest.raises(S2C2AError, match="cannot write"):
        save_figure(figure, tmp_path / "some.png")
    plt.close(figure)
    with pytest.raises(RecordingError, match="cannot write"):
        gather("new.episodes")
    assert (tmp_path / "there.json").read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["there.json"]
