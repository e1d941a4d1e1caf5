import json
import re

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.planning import Outcome
from s2c2a.viz import replay_page
from s2c2a.viz.mesh import ArmMesh, frames_of

NASTY = '</script><script>alert("x")</script>&{{data}}<!--'


def data_of(page: str) -> dict:
    """Data that the page's script reads."""

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    match = re.search(
        r'<script type="application/json" id="run">(.*?)</script>', page, re.DOTALL
    )
    return json.loads(match[1], parse_constant=refuse)


def missing(values) -> list[int]:
    """Steps without a value."""
    return [step for step, value in enumerate(values) if value is None]


@pytest.fixture
def write_page(arm, tmp_path):
    """Write a page and return its text."""

    def write(traces, title="A circle", of_arm=arm, **options):
        return replay_page(
            traces, of_arm, title, tmp_path / "page.html", **options
        ).read_text(encoding="utf-8")

    return write


def test_a_page_is_self_contained(write_page, traces):
    page = write_page(traces)
    assert not re.search(
        r"https?:|//[a-z0-9-]+\.[a-z]|\bimport\b|@import|url\(|\bsrc=|\bhref=|fetch\(",
        page,
    )
    assert "default-src 'none'" in page
    assert "{{" not in page


def test_a_page_of_200_steps_and_three_controllers_is_small(write_page, traces):
    assert len(write_page(traces).encode()) < 300_000


def test_titles_labels_and_summaries_cannot_become_markup(write_page, make_trace):
    page = write_page([make_trace(NASTY)], title=NASTY, summary={NASTY: NASTY})
    assert "alert(" not in re.sub(r"alert\((\\\"|&quot;)x", "", page)
    assert page.count("</script>") == 3
    assert (
        "&lt;/script&gt;&lt;script&gt;alert(&quot;x&quot;)&lt;/script&gt;&amp;{{data}}&lt;!--"
        in page
    )
    data = data_of(page)
    assert data["title"] == data["traces"][0]["label"] == NASTY
    assert data["summary"] == [[NASTY, NASTY]]


def test_the_mean_is_that_of_the_steps_that_count(write_page, make_trace):
    counted = np.arange(200) < 50
    trace = make_trace(lag=0.1, counted=counted)
    unreached = make_trace("unreached", counted=np.zeros(200, bool))
    means = [
        trace["meanError"]
        for trace in data_of(write_page([trace, unreached]))["traces"]
    ]
    assert means == [pytest.approx(trace.position_errors[:50].mean()), None]


def test_nan_becomes_null_and_modules_without_goals_are_omitted(write_page, make_trace):
    trace = make_trace()
    desired, states = trace.desired_positions.copy(), trace.states.copy()
    desired[5:9], states[7] = np.nan, np.nan
    data = data_of(write_page([make_trace(desired_positions=desired, states=states)]))[
        "traces"
    ][0]
    assert list(data["desired"]) == ["2"]
    assert missing(data["desired"]["2"]) == [5, 6, 7, 8]
    assert missing(data["frames"]) == [7]
    assert missing(data["errors"]) == [5, 6, 7, 8]


def test_every_step_is_stored_to_a_tenth_of_a_millimeter(write_page, make_trace):
    trace = make_trace()
    data = data_of(write_page([trace]))["traces"][0]
    assert len(data["frames"]) == len(data["times"]) == 200
    # position, x axis, z axis
    shown = np.array(data["frames"]).reshape(200, 3, 9) / 10_000
    np.testing.assert_allclose(
        shown[..., [0, 1, 2, 6, 7, 8]], trace.states, atol=0.51e-4
    )
    np.testing.assert_allclose(
        np.array(data["errors"]) / 1e6, trace.position_errors, atol=0.51e-6
    )


def test_the_stored_sections_and_frames_reproduce_the_mesh(write_page, make_trace, arm):
    """As in page/arm.js: sections follow the frames, outlines lie in the sections."""
    data, states = data_of(write_page([make_trace()])), make_trace().states[40]
    frames = frames_of(
        np.array(data["traces"][0]["frames"][40]).reshape(3, 9)[:, [0, 1, 2, 6, 7, 8]]
        / 10_000
    )
    places, x, y = [], [], []
    for module, start, slope, end, end_slope, share, radius in data["mesh"]["sections"]:
        near, far = frames[int(module) : int(module) + 2]
        places.append(
            start * near[0] + slope * near[3] + end * far[0] + end_slope * far[3]
        )
        across, along = ((1 - share) * near[k] + share * far[k] for k in (1, 3))
        x.append(radius * across / np.linalg.norm(across))
        y.append(np.cross(along / np.linalg.norm(along), x[-1]))
    places, x, y = (np.array(values)[:, None] for values in (places, x, y))
    for piece, expected in zip(
        data["mesh"]["pieces"], ArmMesh(arm).vertices(states), strict=True
    ):
        got = [
            places[slice(*tube)]
            + np.array(outline)[:, :1] * x[slice(*tube)]
            + np.array(outline)[:, 1:] * y[slice(*tube)]
            for tube in piece["tubes"]
            for outline in piece["outlines"]
        ]
        np.testing.assert_allclose(
            np.concatenate(got).reshape(-1, 3), expected, atol=2e-4
        )


def test_static_obstacles_are_stored_once_and_moving_ones_every_step(
    write_page, make_trace
):
    moving = make_trace().obstacles.copy()
    moving[:, 0, 0] += np.linspace(0, 0.1, 200)
    pages = [write_page([make_trace()]), write_page([make_trace(obstacles=moving)])]
    assert [len(data_of(page)["traces"][0]["obstacles"]) for page in pages] == [1, 200]


def test_a_trace_of_another_arm_and_an_empty_list_are_refused(
    write_page, make_arm, traces
):
    with pytest.raises(S2C2AError, match="3 modules and arm 'test_arm' has 2"):
        write_page(traces, of_arm=make_arm(2))
    with pytest.raises(S2C2AError, match="no trace"):
        write_page([])


def test_a_recording_without_goals_makes_a_page(write_page, make_trace, drawn):
    states = make_trace().states
    data = data_of(write_page([drawn("recorded", np.arange(200.0), states)]))
    assert data["traces"][0]["desired"] == {}
    assert set(data["traces"][0]["errors"]) == {None}


def test_a_page_has_the_tube_of_twice_the_deviation(write_page, make_trace):
    states = make_trace().states
    deviations = np.full((200, 3), 0.01)
    deviations[5] = np.nan
    trace = make_trace(predicted=states, predictive_std=deviations)
    tube = data_of(write_page([trace]))["traces"][0]["tube"]
    assert tube[5] is None
    np.testing.assert_allclose(
        np.array(tube[7][:3]) / 1e4, states[7, -1, :3], atol=1e-4
    )
    assert tube[7][3] == 200
    plain = make_trace(predicted=states, predictive_std=np.zeros((200, 3)))
    assert data_of(write_page([plain]))["traces"][0]["tube"] == []


def test_a_page_has_the_planned_tip_of_the_next_moments(write_page, make_trace):
    horizon = np.tile(make_trace().states[:, -1:, :3], (1, 12, 1))
    horizon[5] = np.nan
    drawn = data_of(write_page([make_trace(horizon=horizon)]))["traces"][0]["horizon"]
    assert drawn[5] == [None] * 12
    np.testing.assert_allclose(np.array(drawn[7]) / 1e4, horizon[7], atol=1e-4)
    assert data_of(write_page([make_trace()]))["traces"][0]["horizon"] == [[]] * 200


def test_the_page_states_at_which_steps_a_plan_does_not_get_nearer(
    write_page, make_trace
):
    outcome = np.zeros(200)
    outcome[50:] = Outcome.OUT_OF_REACH
    plan_error = np.full(200, 0.026)
    plan_error[100:] = 0.031
    trace = make_trace(outcome=outcome, plan_error=plan_error)
    plans = [
        one["plans"] for one in data_of(write_page([trace, make_trace()]))["traces"]
    ]
    text = "plan out of reach, {} cm from its goal"
    assert plans == [[[50, text.format(2.6)], [100, text.format(3.1)]], []]
