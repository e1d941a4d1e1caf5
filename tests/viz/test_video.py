"""Runs as moving pictures."""

import shutil

import numpy as np
import pytest
from PIL import Image

from s2c2a.viz.body import Body
from s2c2a.viz.video import SIZE, save_video


def test_a_run_becomes_a_small_gif(make_trace, arm, tmp_path):
    path = save_video(make_trace(), arm, tmp_path / "run", "gif")
    with Image.open(path) as film:
        assert film.size == SIZE
        assert 50 <= film.n_frames <= 120
        film.seek(film.n_frames // 2)
        red, green, blue = np.moveaxis(np.array(film.convert("RGB"), dtype=int), -1, 0)
    for first, second, third in ((red, green, blue), (green, red, blue), (blue, red, green)):
        assert np.sum(first - np.maximum(second, third) > 40) > 300  # every module is seen
    assert path.stat().st_size < 2_000_000


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")
def test_a_run_becomes_a_film_where_ffmpeg_is_found(make_trace, arm, tmp_path):
    assert save_video(make_trace(), arm, tmp_path / "run").suffix == ".mp4"


def test_the_body_is_closed_and_faces_outwards(make_trace, arm):
    body, states = Body(arm), make_trace().states[0]
    shape = body.shape(states)
    for vertices, faces in ((shape.discs, body.disc_faces), (shape.modules[0], body.tube_faces)):
        a, b, c = np.swapaxes(vertices[faces], 0, 1)
        assert np.einsum("fk,fk->", a, np.cross(b, c)) > 0  # six times the volume
    np.testing.assert_allclose(shape.discs[-1], states[-1, :3], atol=0.01)
    np.testing.assert_allclose(shape.modules[-1].reshape(-1, 20, 3)[-1].mean(axis=0), states[-1, :3], atol=1e-6)
