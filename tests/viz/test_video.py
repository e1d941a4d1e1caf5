"""Videos of runs."""

import shutil

import numpy as np
import pytest
from PIL import Image

from s2c2a.viz.video import SIZE, VideoRenderer, save_video


def test_a_run_becomes_a_small_gif(make_trace, arm, tmp_path):
    path = save_video(make_trace(), arm, tmp_path / "run", "gif")
    with Image.open(path) as video:
        assert video.size == SIZE
        assert 50 <= video.n_frames <= 120
        video.seek(video.n_frames // 2)
        red, green, blue = np.moveaxis(np.array(video.convert("RGB"), dtype=int), -1, 0)
    for first, second, third in (
        (red, green, blue),
        (green, red, blue),
        (blue, red, green),
    ):
        # every module is visible
        assert np.sum(first - np.maximum(second, third) > 40) > 300
    assert path.stat().st_size < 2_000_000


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_a_run_becomes_an_mp4_if_ffmpeg_is_installed(make_trace, arm, tmp_path):
    assert save_video(make_trace(), arm, tmp_path / "run").suffix == ".mp4"


@pytest.mark.parametrize(
    ("gravity", "below"), [((0, 0, -1), False), ((0, 0, 0), False), ((0, 0, 1), True)]
)
def test_the_tip_of_a_hanging_arm_is_below_its_base(
    make_arm, straight, tip_is_below, gravity, below, drawn
):
    renderer = VideoRenderer(make_arm(gravity_direction=gravity))
    trace = drawn("s2c2a", [0.0], straight[None])
    assert tip_is_below(np.array(renderer.frame(trace, 0))) == below
    rows = renderer.project(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6]]))[:, 1]
    assert (rows[1] > rows[0] + 200) == below  # rows are counted from the top


def test_a_lying_arm_is_level_and_shown_from_the_side(make_arm):
    for gravity in ((1, 0, 0), (0, -1, 0), (-0.6, 0.8, 0)):
        base, tip = VideoRenderer(make_arm(gravity_direction=gravity)).project(
            np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6]])
        )
        assert tip[0] - base[0] > 3 * abs(tip[1] - base[1])


def test_an_arm_with_unknown_states_is_not_drawn(make_trace, arm):
    unknown = make_trace(states=np.full((200, 3, 6), np.nan))
    red, green, blue = np.moveaxis(
        np.array(VideoRenderer(arm).frame(unknown, 5), dtype=int), -1, 0
    )
    assert np.sum(red - np.maximum(green, blue) > 40) == 0
