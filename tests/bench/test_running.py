"""Parts run apart from each other, and what was measured is kept whatever happens."""

import io
import json
import subprocess
import sys
from dataclasses import replace
from typing import get_args

import pytest

from s2c2a.bench import runner, service
from s2c2a.bench.lines import Failed, line_from_json, options_to_json
from s2c2a.bench.machine import extra_versions, resident_memory
from s2c2a.bench.measurement import Growth, Limit, Measurement
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.parts import PARTS, Part
from s2c2a.bench.report import Report
from s2c2a.bench.runner import chosen, lines_of
from s2c2a.bench.startup import Launch, launched
from s2c2a.cli.bench import PartName
from s2c2a.cli.main import main
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.shards import all_cores

ONE = Measurement("one", "s", 1.0, limit=Limit(0.5))


class FakePart:
    """A part that measures one thing and then does something else."""

    def __init__(self, after):
        self._after = after

    def measure(self, options, progress):
        progress("measuring", 1, 2)
        yield ONE
        self._after()


def served(monkeypatch, twin, after) -> list:
    monkeypatch.setattr(service, "PARTS", {"fake": FakePart(after)})
    options = options_to_json(BenchOptions(twin))
    said = io.StringIO()
    service.serve(json.dumps({"part": "fake", "options": options}), said)
    messages = [json.loads(line) for line in said.getvalue().splitlines()]
    assert messages[0] == {"progress": ["measuring", 1, 2]}
    return [line_from_json(message["line"]) for message in messages if "line" in message]


def nothing() -> None:
    """A part that ends well."""


def user_error() -> None:
    raise ArmError("no such arm")


def bug() -> None:
    raise ZeroDivisionError("by nothing")


def test_a_part_tells_its_lines_and_its_peak_memory(monkeypatch, twin):
    one, peak = served(monkeypatch, twin, nothing)
    assert one == ONE
    assert peak.unit == "MiB"
    assert peak.median > 10.0


@pytest.mark.parametrize(("after", "said"), [(user_error, "no such arm"), (bug, "ZeroDivisionError")])
def test_what_was_measured_before_a_failure_is_told(monkeypatch, twin, after, said):
    one, failed, _ = served(monkeypatch, twin, after)
    assert one == ONE
    assert isinstance(failed, Failed)
    assert said in failed.why


def test_a_gpu_that_is_not_there_is_told_with_what_to_do(monkeypatch):
    monkeypatch.setattr(service.jax, "devices", bug)
    service.check_device("cpu")
    with pytest.raises(S2C2AError, match="--device cpu"):
        service.check_device("gpu")


def test_a_process_that_dies_is_told_with_its_last_words(monkeypatch, twin):
    monkeypatch.setattr(runner, "WORKER", "s2c2a.bench.no_such_module")
    (failed,) = lines_of(PARTS["rods"], BenchOptions(twin), lambda *_: None)
    assert isinstance(failed, Failed)
    assert "no_such_module" in failed.why


def test_leaving_early_ends_the_process(monkeypatch, twin):
    started = []

    class Watched(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)

    def interrupted(doing, done, total):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner.subprocess, "Popen", Watched)
    with pytest.raises(KeyboardInterrupt):
        list(lines_of(PARTS["collect"], BenchOptions(twin), interrupted))
    assert started[0].poll() is not None


def test_every_part_is_a_module_that_measures_and_a_word_on_the_command_line():
    assert set(get_args(PartName)) == set(PARTS)
    assert all(callable(part.measure) for part in PARTS.values())


def test_parts_run_in_their_own_order_and_all_if_none_is_named():
    assert [part.name for part in chosen(("step", "plan"))] == ["plan", "step"]
    assert chosen(()) == list(PARTS.values())
    with pytest.raises(S2C2AError, match="choose from startup"):
        chosen(("speed",))


def test_the_report_is_whole_after_every_line(tmp_path, twin):
    report, part = Report(tmp_path / "bench.json", BenchOptions(twin, seed=4)), Part("plan", 1, "")
    report.begin(part)
    for line in (ONE, Failed("plan", "no arm"), Growth("modules", "plan", (1, 2), (1.0, 2.0), (1.0, 2.0), 3)):
        report.add(part, line)
        written = json.loads(report.path.read_text())
        assert written["parts"]["plan"]["lines"][-1]["kind"] == type(line).__name__
    assert written["seed"] == 4
    assert written["parts"]["plan"]["cores"] == 1
    assert written["parts"]["plan"]["lines"][0]["kept"] is False
    assert {"s2c2a", "jax", "python"} <= written["versions"].keys()
    assert {"processor", "cores", "load_average"} <= written["machine"].keys()
    assert report.missed() == ["plan: one"]
    assert report.failed() == ["plan"]
    assert [growth.of for growth in report.growths()] == ["modules"]


def test_a_launch_tells_time_and_peak_of_the_command_and_not_of_who_starts_it():
    held = [0] * 30_000_000  # 240 MB of ours, which Linux would count as the command's
    launches = {name: Launch((sys.executable, "-S", "-c", code)) for name, code in LAUNCHED.items()}
    lines = {line.what: line for line in launched(launches, 2, lambda done, total: None)}
    assert len(held) == 30_000_000
    assert lines["sleep"].median > 0.3
    assert lines["sleep: peak memory"].median < 60.0
    assert lines["hold: peak memory"].median > 150.0


LAUNCHED = {"sleep": "import time; time.sleep(0.3)", "hold": "held = bytes([1]) * 160_000_000"}


@pytest.mark.skipif(sys.platform != "linux", reason="other systems count otherwise")
def test_the_peak_of_a_part_is_not_that_of_who_starts_it():
    held = bytes([1]) * 200_000_000
    code = "from s2c2a.bench.machine import peak_memory; print(peak_memory())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert len(held) == 200_000_000
    assert float(done.stdout) < 60.0


def test_a_command_that_fails_is_told():
    with pytest.raises(S2C2AError, match="ended with 3"):
        Launch((sys.executable, "-c", "import sys; sys.exit(3)"))()


def test_a_process_can_be_kept_to_one_core():
    code = "from s2c2a.bench.machine import keep_to; keep_to(1); from s2c2a.shards import all_cores; print(all_cores())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) == 1 <= all_cores()


def test_the_machine_tells_its_memory_and_what_is_installed():
    assert resident_memory() is None or resident_memory() > 10.0
    assert all(isinstance(version, str) for version in extra_versions().values())


def test_one_part_goes_from_the_command_line_to_table_and_file(tmp_path, capsys):
    main(["bench", "collect", "--quick", "--arm", "simulated_arm", "--out", str(tmp_path / "run")])
    said = capsys.readouterr().out
    assert "1000 samples" in said
    assert "peak memory of this part" in said
    report = json.loads((tmp_path / "run" / "bench.json").read_text())
    line = report["parts"]["collect"]["lines"][0]
    assert 0 < line["median"] < 600
    assert line["limit"] is None
    assert report["options"]["quick"] is True


def test_a_failed_part_makes_the_command_fail_after_the_others(tmp_path, capsys, monkeypatch, twin):
    def fake(part, options, progress):
        yield replace(ONE, what=f"{part.name} is measured")
        if part.name == "plan":
            yield Failed("plan", "no arm")

    monkeypatch.setattr(runner, "lines_of", fake)
    with pytest.raises(SystemExit) as stopped:
        main(["bench", "plan", "step", "--out", str(tmp_path / "run")])
    assert stopped.value.code == 1
    said = capsys.readouterr().out
    assert "step is measured" in said
    assert "failed: plan" in said
    assert "missed: plan: plan is measured; step: step is measured" in said


def test_an_interrupt_keeps_what_was_measured(tmp_path, capsys, monkeypatch):
    def fake(part, options, progress):
        yield ONE
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "lines_of", fake)
    with pytest.raises(SystemExit) as stopped:
        main(["bench", "plan", "--out", str(tmp_path / "run")])
    assert stopped.value.code == 130
    assert "one" in capsys.readouterr().out
    assert len(json.loads((tmp_path / "run" / "bench.json").read_text())["parts"]["plan"]["lines"]) == 1
