"""An edit of custom code makes anew what depends on it, whatever kind of code it is."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

import s2c2a
from s2c2a.arm.sensors import Raw, Sensors
from s2c2a.arm.tracking import Tracking
from s2c2a.control.options import CONTROLLERS
from s2c2a.data import CollectOptions
from s2c2a.execution import sources
from s2c2a.execution.sources import code_digest
from s2c2a.jobs import (
    Conditions,
    NetworksArtifact,
    PriorNetworks,
    RecordingArtifact,
    jobs_for,
)
from s2c2a.models.registry import MODELS
from s2c2a.plugins.components import CustomComponent
from s2c2a.robots import RobotFactory
from s2c2a.strategies import recipe_named

BEST = recipe_named("best")
GROUP = re.compile(r'(?:resolve\(|Registry\()\s*"(\w+)"', re.MULTILINE)
BASES = {
    "strategy": "s2c2a.strategies.S2C2A",
    "model": "s2c2a.models.LocalOptions",
    "controller": "s2c2a.control.options.C2AOptions",
}
"""Classes that are imported before anything is made; all others are named only."""


def job_of(arm, recipe=BEST, strategy="s2c2a", conditions=None):
    conditions = conditions or Conditions()
    return jobs_for(["circle"], arm, [strategy], [0], recipe, conditions)[0]


def planned_with(twin, **changes):
    return job_of(twin, replace(BEST, planner=replace(BEST.planner, **changes)))


def strategy_artifacts(name, twin, recipe=BEST):
    job = job_of(twin, recipe, name)
    return [job, *job.needs]


def model_artifacts(name, twin):
    recipe = replace(BEST, c2s=MODELS.named(name)(model=name))
    return strategy_artifacts("s2c2a", twin, recipe)


def controller_artifacts(name, twin):
    recipe = replace(BEST, c2a=CONTROLLERS.named(name)(model=name))
    return strategy_artifacts("s2c2a", twin, recipe)


def arm_artifacts(arm):
    recording = CollectOptions(episodes=1)
    return [
        job_of(arm),
        RecordingArtifact(arm, recording),
        NetworksArtifact(arm, BEST, 0),
        PriorNetworks(arm, BEST),
    ]


def sensor_artifacts(name, twin):
    return arm_artifacts(twin.model_copy(update={"sensing": name}))


def sensor_model_artifacts(name, twin):
    raw = Raw(name="mine", shape=(2,), model=name)
    return arm_artifacts(twin.model_copy(update={"sensors": Sensors(raw=(raw,))}))


def tracker_artifacts(name, twin):
    tracking = Tracking(source=f"{name},port=9")
    driven = Conditions(RobotFactory("walker", (), f"{name},port=9"))
    tracked = twin.model_copy(update={"tracking": tracking})
    return [job_of(tracked), job_of(twin, conditions=driven)]


ARTIFACTS = {
    "strategy": strategy_artifacts,
    "model": model_artifacts,
    "controller": controller_artifacts,
    # a job asks the estimator for the arm of its training, and imports it
    "estimator": lambda name, twin: [
        NetworksArtifact(twin, replace(BEST, estimator=CustomComponent(name)), 0)
    ],
    "solver": lambda name, twin: [planned_with(twin, solver=CustomComponent(name))],
    "guide": lambda name, twin: [planned_with(twin, guides=(CustomComponent(name),))],
    "term": lambda name, twin: [planned_with(twin, terms=(CustomComponent(name),))],
    "robot": lambda name, twin: [
        job_of(twin, conditions=Conditions(RobotFactory(name)))
    ],
    "sensor": sensor_artifacts,
    "sensor_model": sensor_model_artifacts,
    "tracker": tracker_artifacts,
}
"""By kind of custom code: all artifacts that depend on it."""
WITHOUT_RESULTS = {"export", "stream"}
"""What it makes is not cached."""
KEPT_BY_CONTENT = {"task"}
"""The goals that the code made are in the key (`test_artifacts`)."""


def written(folder, kind):
    """A file of custom code with a class `Mine`, and a helper module that it imports."""
    module = f"own_{kind}_code"
    base = BASES.get(kind, "builtins.object")
    place, _, parent = base.rpartition(".")
    helper = folder / f"{module}_helper.py"
    helper.write_text("GAIN = 1.0\n")
    file = folder / f"{module}.py"
    file.write_text(
        "from dataclasses import dataclass\n"
        f"from {helper.stem} import GAIN\n"
        f"from {place} import {parent}\n\n\n"
        f"@dataclass(frozen=True)\nclass Mine({parent}):\n    pass\n"
    )
    return file, helper


def test_every_kind_of_custom_code_is_tried():
    source = Path(s2c2a.__file__).parent
    found = set()
    for file in source.rglob("*.py"):
        found.update(GROUP.findall(file.read_text(encoding="utf-8")))
    found.remove("robot_wrapper")  # the package names its own alone
    assert found == ARTIFACTS.keys() | KEPT_BY_CONTENT | WITHOUT_RESULTS


@pytest.mark.parametrize("kind", ARTIFACTS)
def test_an_edit_changes_the_key_of_everything_that_depends_on_the_code(
    kind, twin, tmp_path
):
    file, helper = written(tmp_path, kind)

    def keys():
        artifacts = ARTIFACTS[kind](f"{file}:Mine", twin)
        return [artifact.file for artifact in artifacts]

    first = keys()
    assert keys() == first
    for edited in (file, helper):
        edited.write_text(edited.read_text() + "# edited\n")
        changed = keys()
        assert not set(changed) & set(first)
        first = changed


REACH = {
    "robots/simulation/chain.py": {"recording", "networks", "run"},
    "training/fit.py": {"networks", "run"},
    "models/local_training.py": {"networks", "run"},
    "evaluation/rollout.py": {"run"},
    "viz/figures.py": set(),
    "cli/train.py": set(),
    "../docs/index.md": set(),
}
"""File of the package -> what it makes."""


def test_artifacts_count_the_sources_that_make_them(twin, monkeypatch):
    read = set()

    def noted(file, read_file=sources._read):
        read.add(file)
        return read_file(file)

    monkeypatch.setattr(sources, "_kept", noted)
    run = job_of(twin)
    artifacts = {
        "run": run,
        "networks": run.needs[0],
        "recording": run.needs[0].needs[0],
    }
    for made, artifact in artifacts.items():
        read.clear()
        assert artifact.file
        for file, makes in REACH.items():
            assert (sources.PACKAGE / file in read) == (made in makes), (made, file)


def test_modules_and_packages_count_with_the_modules_that_they_import(
    tmp_path, monkeypatch
):
    package = tmp_path / "own_package"
    (package / "parts").mkdir(parents=True)
    (package / "__init__.py").write_text("from own_package import deep\n")
    (package / "deep.py").write_text("from .parts import inner\n")
    (package / "parts" / "__init__.py").write_text("import numpy\n")
    (package / "parts" / "inner.py").write_text("VALUE = 1\n")
    (package / "unused.py").write_text("VALUE = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    first = code_digest({"name": "own_package:Mine"})
    assert first
    (package / "unused.py").write_text("VALUE = 2\n")
    assert code_digest(["own_package:Mine"]) == first
    (package / "parts" / "inner.py").write_text("VALUE = 2\n")
    assert code_digest("own_package:Mine") != first


PACKAGES = {
    "a name that a package changes": {
        "__init__.py": "from .a import G\nG = 2 * G\n",
        "a.py": "G = 1\n",
    },
    "stars": {
        "__init__.py": "from .a import *\nfrom .b import *\n",
        "a.py": "",
        "b.py": "G = 1\n",
    },
    "one of two": {
        "__init__.py": "try:\n    from .a import G\nexcept ImportError:\n    from .b import G\n",
        "a.py": "G = 1\n",
        "b.py": "G = 1\n",
    },
    "not for types": {
        "__init__.py": "import typing\nif not typing.TYPE_CHECKING:\n    from .a import G\n",
        "a.py": "G = 1\n",
    },
    "a folder within": {
        "__init__.py": "from own.deep.a import G\n",
        "deep/a.py": "G = 1\n",
    },
}
"""Files of a package `own`, by the way in which it takes a name from others."""


@pytest.mark.parametrize("kind", PACKAGES)
def test_an_edit_of_any_file_that_an_import_runs_counts(kind, tmp_path):
    for name, text in PACKAGES[kind].items():
        place = tmp_path / "own" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    (tmp_path / "mine.py").write_text("from own import G\n")
    before = code_digest(f"{tmp_path}/mine.py:Mine")
    for name in PACKAGES[kind]:
        with (tmp_path / "own" / name).open("a") as file:
            file.write("# edited\n")
        after = code_digest(f"{tmp_path}/mine.py:Mine")
        assert after != before, name
        before = after


def test_threads_may_ask_at_once(tmp_path):
    deep = "x = " + "(" * 90 + "1" + ")" * 90 + "\n"
    for number in range(40):
        (tmp_path / f"part{number}.py").write_text(f"# {number}\n" + deep * 100)
    names = [f"{tmp_path}/part{number}.py:Mine" for number in range(40)]
    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(code_digest, names))) == len(names)


def test_a_helper_that_is_written_later_counts(tmp_path):
    (tmp_path / "mine.py").write_text("from later import G\n")
    before = code_digest(f"{tmp_path}/mine.py:Mine")
    (tmp_path / "later.py").write_text("G = 1\n")
    assert code_digest(f"{tmp_path}/mine.py:Mine") != before


NO_CODE = {text: text for text in ("", "circle", "json:loads", "udp:9763", "a.py:B")}
NO_CODE |= {
    "part of a package": "jax.numpy:abs",
    "long": "x" * 5000 + ".py:X",
    "deep": ".".join(["a"] * 3000) + ":X",
    "null": "\0.py:X",
    "device": "/dev/zero.py:X",
}


@pytest.mark.parametrize("text", NO_CODE.values(), ids=NO_CODE)
def test_texts_that_name_no_custom_code_have_no_digest(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert code_digest(text) == ""


@pytest.mark.parametrize(
    "text",
    [
        "-" * 200_000 + "1",
        "a" + ".a" * 100_000,
        "\0",
        f"from {'.' * 200}above import name\n",
    ],
    ids=["signs", "deep", "null", "above all folders"],
)
def test_strange_code_in_a_folder_with_a_comma_has_a_digest(text, tmp_path):
    file = tmp_path / "data,2" / "strange.py"
    file.parent.mkdir()
    file.write_text(text)
    assert code_digest(f"{file}:X")
