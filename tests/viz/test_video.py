"""Videos of runs."""

import numpy as np
import pytest
from PIL import Image

from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.video import (
    SIZE,
    FFMpegWriter,
    PillowWriter,
    VideoStage,
    save_video,
)


@pytest.mark.slow
def test_a_run_becomes_a_small_gif(make_trace, tmp_path):
    path = tmp_path / "run.gif"
    save_video(make_trace(), path, PillowWriter)
    with Image.open(path) as video:
        assert video.size == SIZE
        assert 50 <= video.n_frames <= 120
        video.seek(video.n_frames // 2)
        pixels = np.array(video.convert("RGB"), dtype=int)
    for color in range(3):  # every module is visible
        assert len(places_of(pixels, color)) > 300
    assert path.stat().st_size < 2_000_000


def picture_of(arm, trace, step=0) -> np.ndarray:
    """Pixels of one frame."""
    stage = VideoStage(arm)
    stage.draw(trace, step)
    stage.figure.canvas.draw()
    return np.array(stage.figure.canvas.buffer_rgba(), dtype=int)[..., :3]


def places_of(pixels: np.ndarray, color: int) -> np.ndarray:
    """Rows and columns of what is mainly red (0), green (1) or blue (2)."""
    others = np.delete(pixels, color, axis=-1).max(axis=-1)
    return np.argwhere(pixels[..., color] - others > 40)


def middle_of(pixels: np.ndarray, color: int) -> np.ndarray:
    places = places_of(pixels, color)
    assert len(places) > 100
    return places.mean(axis=0)


@pytest.fixture
def tip_from_base(make_arm, straight, drawn):
    """Pixels down and to the right from the middle of the base's module to the tip's."""

    def look(*gravity):
        trace = drawn("s2c2a", [0.0], straight[None])
        pixels = picture_of(make_arm(gravity_direction=gravity), trace)
        return middle_of(pixels, 0) - middle_of(pixels, 2)  # red tip, blue base

    return look


@pytest.mark.parametrize(("gravity", "sign"), [(-1, -1), (0, -1), (1, 1)])
def test_the_tip_of_a_hanging_arm_is_below_its_base(tip_from_base, gravity, sign):
    down, _ = tip_from_base(0, 0, gravity)
    assert sign * down > 20


@pytest.mark.parametrize("gravity", [(1, 0, 0), (0, -1, 0), (-0.6, 0.8, 0)])
def test_a_lying_arm_is_level_and_shown_from_the_side(tip_from_base, gravity):
    down, right = tip_from_base(*gravity)
    assert right > 3 * abs(down)
    assert right > 100


def test_an_arm_with_unknown_states_is_not_drawn(make_trace, arm):
    unknown = make_trace(states=np.full((200, 3, 6), np.nan))
    assert len(places_of(picture_of(arm, unknown, 5), 0)) == 0


def test_a_failing_ffmpeg_is_an_error_that_says_how_to_get_a_gif(
    make_trace, tmp_path, monkeypatch
):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    with pytest.raises(S2C2AError, match=r"cannot make the video.*--to gif"):
        save_video(make_trace(), tmp_path / "run.mp4", FFMpegWriter)
    assert not (tmp_path / "run.mp4").exists()


def test_a_ball_hides_the_arm_behind_it_only(arm, straight, drawn):
    reds = []
    for side in (-1, 1):  # behind and before the last module, as the camera sees them
        ball = np.array([0.64 * side, -0.77 * side, 0.55]) * (0.12, 0.12, 1.0)
        obstacles = np.array([[[*ball, 0.06]]])
        trace = drawn("s2c2a", [0.0], straight[None], obstacles=obstacles)
        reds.append(len(places_of(picture_of(arm, trace), 0)))
    behind, before = reds
    assert behind > 2 * before
