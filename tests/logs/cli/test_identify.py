"""Command `s2c2a identify`: a recording and an initial arm give a fitted arm file."""

import pytest

from s2c2a.arm import load_arm, save_arm
from s2c2a.cli.main import FAULT, main
from s2c2a.data import CollectOptions, collect
from s2c2a.robots.simulation import SimulatedRobot


@pytest.fixture(scope="module")
def files(make_arm, tmp_path_factory):
    """A recording of a soft module, and the arm file of a stiffer one."""
    folder = tmp_path_factory.mktemp("identify")
    soft = make_arm(
        modules=1, module={"bending_stiffness": 0.1, "cable": {"stiffness": 1000.0}}
    )
    options = CollectOptions(episodes=1, samples=40)
    collect(
        folder / "soft.episodes",
        soft,
        lambda seed: SimulatedRobot(soft, seed=seed),
        options,
        threads=1,
    )
    save_arm(
        make_arm(modules=1, module={"cable": {"stiffness": 1000.0}}),
        folder / "start.toml",
    )
    return folder


def command(files, *more: str) -> None:
    recording, start, out = (
        str(files / name) for name in ("soft.episodes", "start.toml", "fitted.toml")
    )
    options = ["--jobs", "1", "--fit", "stiffness", "--rounds", "4"]
    main(["identify", recording, "--arm", start, "--out", out, *options, *more])


def test_the_fitted_arm_has_a_smaller_error_which_is_reported(files, capsys):
    command(files, "--on", str(files / "soft.episodes"))
    output = capsys.readouterr().out
    assert load_arm(files / "fitted.toml").modules[
        0
    ].bending_stiffness == pytest.approx(0.1, rel=0.01)
    assert "modules.0.bending_stiffness" in output
    assert "fitted rows" in output
    assert "soft.episodes (39): tip error mean 0.0 mm" in output


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ((), "exists"),
        (("--overwrite", "--rows", "10"), "say --settling"),
        (("--overwrite", "--fit", "color"), "choose from stiffness"),
        (("--overwrite", "--settling", "-1"), "settling of"),
        (("--overwrite", "--arm", "twin_arm"), "give the arm that was recorded"),
    ],
)
def test_invalid_arguments_are_rejected_before_the_fit(files, capsys, more, fault):
    (files / "fitted.toml").touch()
    with pytest.raises(SystemExit) as ended:
        command(files, *more)
    assert ended.value.code == FAULT
    assert fault in capsys.readouterr().err
