"""What `run` says about waypoints before the arm moves."""

from s2c2a.arm import load_arm
from s2c2a.cli.run import _paced_task


def written(tmp_path, *rows):
    path = tmp_path / "path.csv"
    path.write_text("\n".join(["time,x,y,z", *rows]), encoding="utf-8")
    return str(path)


def test_waypoints_behind_the_base_are_explained(tmp_path, capsys):
    _paced_task(
        written(tmp_path, "0,0,0,-0.6", "4,0.1,0,-0.5"), load_arm("twin_arm"), 1
    )
    printed = capsys.readouterr().out
    assert "2 of 2 waypoints of the tip are out of reach" in printed
    assert "z grows from the base toward the tip" in printed


def test_reachable_waypoints_are_silent(tmp_path, capsys):
    _paced_task(written(tmp_path, "0,0,0,0.6", "4,0.1,0,0.58"), load_arm("twin_arm"), 1)
    assert capsys.readouterr().out == ""


def test_a_pace_in_the_name_reports_the_same_as_the_option(tmp_path, capsys):
    path = written(tmp_path, "0,0,0,-0.6", "4,0.9,0,0.5")
    _paced_task(path, load_arm("twin_arm"), 0.5)
    by_option = capsys.readouterr().out
    _paced_task(f"{path}@0.5", load_arm("twin_arm"), 1)
    assert by_option
    assert capsys.readouterr().out == by_option


def test_many_waypoints_out_of_reach_take_one_line(tmp_path, capsys):
    far = {3, 4, 5, 8, 11, 12}
    rows = [f"{time},{0.9 if time in far else 0},0,0.6" for time in range(14)]
    _paced_task(written(tmp_path, *rows), load_arm("twin_arm"), 1)
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    assert "6 of 14 waypoints of the tip are out of reach, by up to " in printed
    assert "3 to 5, 8, 11 to 12 s" in printed
