"""Strategy files: round trips, arms they were not trained for, and every way of being damaged."""

import io
import json
import subprocess
import sys

import equinox as eqx
import jax
import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save

from s2c2a.arm import Cable
from s2c2a.episodes.blocks import WORD
from s2c2a.errors import StrategyError
from s2c2a.strategies import load_networks, save_networks
from s2c2a.strategies.checkpoint import SCHEMA


@pytest.fixture(params=["paper", "best"])
def saved(request):
    """Networks of either recipe, and the file that they were saved to."""
    of_kind = {
        "paper": ("tiny_networks", "strategy_file"),
        "best": ("tiny_best_networks", "best_strategy_file"),
    }
    return tuple(request.getfixturevalue(name) for name in of_kind[request.param])


def contents(path) -> tuple[dict, dict]:
    """Arrays and metadata of a strategy file."""
    with safe_open(path, framework="numpy") as file:
        return load_file(path), json.loads(file.metadata()["s2c2a"])


@pytest.fixture
def rewrite(strategy_file, forged):
    """Change metadata or arrays of the strategy file and give it a valid digest."""

    def write(metadata: dict | None = None, without: tuple = (), **arrays):
        def change(known, found):
            known |= metadata or {}
            found |= arrays
            for name in without:
                (known if name in known else found).pop(name)

        return forged(strategy_file, change)

    return write


def test_equal_networks_are_equal_files_to_the_last_byte(saved, tmp_path):
    for number in range(8):
        save_networks(saved[0], tmp_path / str(number))
    assert {path.read_bytes() for path in tmp_path.iterdir()} == {saved[1].read_bytes()}


def test_the_same_arm_under_another_name_is_accepted(strategy_file, twin):
    renamed = twin.model_copy(update={"name": "ours", "description": "the same body"})
    one, two = load_networks(strategy_file, renamed), load_networks(strategy_file)
    assert one.arm == renamed
    assert eqx.tree_equal(one.networks, two.networks)


def softer(arm):
    """The arm with a softer last cable."""
    last = arm.modules[-1].model_copy(update={"cable": Cable(stiffness=2000.0)})
    return arm.model_copy(update={"modules": (*arm.modules[:-1], last)})


OTHER_ARMS = {
    "control_rate": lambda arm: arm.model_copy(update={"control_rate": 20.0}),
    "coupled_cables": lambda arm: arm.model_copy(update={"coupled_cables": True}),
    "motor": lambda arm: arm.model_copy(
        update={"motor": arm.motor.model_copy(update={"time_constant": 0.1})}
    ),
    "modules": softer,
    "sensing": lambda arm: arm.model_copy(update={"sensing": "true"}),
}


@pytest.mark.parametrize(("field", "change"), OTHER_ARMS.items(), ids=OTHER_ARMS)
def test_a_strategy_of_another_arm_is_refused_and_the_difference_named(
    strategy_file, twin, field, change
):
    other = change(twin).model_copy(update={"name": "other"})
    with pytest.raises(StrategyError, match=rf"'twin_arm'.*'other' in {field}.* now "):
        load_networks(strategy_file, other)


def test_the_first_differences_are_named_and_the_others_counted(
    strategy_file, simulated
):
    with pytest.raises(StrategyError, match=r"in actuation .* and \d+ more;"):
        load_networks(strategy_file, simulated)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(StrategyError, match="no strategy at"):
        load_networks(tmp_path / "nothing.safetensors")
    with pytest.raises(StrategyError, match=r"shiped \(did you mean shipped\?\)"):
        load_networks("shiped")


def test_a_recording_in_place_of_networks_is_named(tmp_path):
    recording = tmp_path / "mine.episodes"
    recording.write_bytes(WORD + bytes(100))
    with pytest.raises(StrategyError, match="is a recording or a run, not networks"):
        load_networks(recording)


@pytest.mark.parametrize("schema", [1, SCHEMA - 1, SCHEMA + 1])
def test_another_schema_is_refused_and_how_to_make_the_file_again_said(rewrite, schema):
    with pytest.raises(
        StrategyError,
        match=rf"schema {schema}, and this version reads {SCHEMA}.*`s2c2a train`",
    ):
        load_networks(rewrite({"schema_version": schema}))


BILSTM = {"model": "bilstm", "layers": 1, "hidden": 8}
WRONG_RECIPES = {
    "a word": "soup",
    "nothing": {},
    "words for numbers": {"c2s": BILSTM | {"layers": "many"}},
    "no layer": {"c2s": BILSTM | {"layers": 0}},
    "no hidden state": {"c2s": BILSTM | {"hidden": 0}},
    "no model": {"c2s": {"layers": 1, "hidden": 8}},
    "a model that is none": {"c2s": BILSTM | {"model": ["bilstm"]}},
    "another model's numbers": {"c2s": BILSTM | {"model": "chain"}},
    "an integral gain of NaN": {"integral_gain": float("nan")},
    "noise without end": {"history_noise": float("inf")},
    "a weight of NaN": {"axis_weights": [["hold-", float("nan")]]},
    "a year of training": {"c2s_fit": {"max_epochs": 10**9}},
    "fewer than none": {"c2a": {"layers": 1, "hidden": -8}},
    "no iteration": {
        "planner": {"learning_rate": 0.02, "iterations": -1, "on_sphere": True}
    },
    "no number": {
        "planner": {"learning_rate": "fast", "iterations": 10, "on_sphere": True}
    },
    "a size of no known form": {"c2a": {"layers": 1, "hidden": 8, "heads": 2}},
    "a word that no recipe has": {"luck": 1.0},
    "a width below zero": {"c2s": {"model": "chain", "play_widths": [0.03, -0.05]}},
    "widths without end": {"c2s": {"model": "chain", "play_widths": [0.03] * 100_000}},
}


@pytest.mark.parametrize("recipe", WRONG_RECIPES.values(), ids=WRONG_RECIPES)
def test_an_impossible_recipe_is_refused(rewrite, strategy_file, recipe):
    known = contents(strategy_file)[1]["recipe"] if recipe else {}
    with pytest.raises(StrategyError, match="damaged"):
        load_networks(
            rewrite({"recipe": known | recipe if isinstance(recipe, dict) else recipe})
        )


REFUSED_IN_4_GB = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, (4 << 30, 4 << 30))
from s2c2a.errors import StrategyError
from s2c2a.strategies import load_networks
for path in sys.argv[1:]:
    try: load_networks(path)
    except StrategyError: print("refused")
"""


def test_networks_larger_than_any_machine_holds_are_refused_and_not_built(
    rewrite, strategy_file, tmp_path
):
    """In a process of their own, since running out of memory ends it."""
    recipe, paths = contents(strategy_file)[1]["recipe"], []
    for size in ({"hidden": 10**9}, {"layers": 32, "hidden": 4096}):
        huge = rewrite({"recipe": recipe | {"c2s": BILSTM | size}})
        paths.append(huge.rename(tmp_path / f"{len(paths)}.safetensors"))
    done = subprocess.run(
        [sys.executable, "-c", REFUSED_IN_4_GB, *paths],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout.split() == ["refused"] * 2, done.stderr


def test_what_follows_from_the_arm_is_not_taken_from_the_file(rewrite, tiny_networks):
    """A file cannot make a controller speak other cables than its arm has."""
    forged = {
        "C2A.sum_and_range.high": np.full((3, 3), 9.0, np.float32),
        "C2A.sum_and_range.unit": np.ones((3, 1)),
    }
    loaded, layer = load_networks(rewrite(**forged)), tiny_networks.c2a.sum_and_range
    np.testing.assert_array_equal(loaded.c2a.sum_and_range.high, layer.high)
    np.testing.assert_array_equal(loaded.c2a.sum_and_range.unit, layer.unit)


def test_what_follows_from_the_arm_is_no_part_of_the_file_of_a_chain(
    best_strategy_file, tiny_best_networks
):
    """Lengths and cables are the arm's; the file holds only what was learned."""
    names = contents(best_strategy_file)[0].keys()
    assert len(jax.tree.leaves(tiny_best_networks.c2s.body)) > 0
    assert [name for name in names if ".body" in name] == []


@pytest.mark.parametrize("kind", ["strategy_file", "best_strategy_file"])
def test_a_byte_that_changes_anywhere_is_noticed(request, tmp_path, kind):
    """Of 300 places, half of them in the header: refused as a strategy, and with no other error."""
    whole = request.getfixturevalue(kind).read_bytes()
    random, length = np.random.default_rng(0), int.from_bytes(whole[:8], "little")
    places = np.concatenate(
        [
            random.integers(0, 8 + length, 150),
            random.integers(8 + length, len(whole), 150),
        ]
    )
    for place in places:
        flipped = bytearray(whole)
        flipped[place] ^= int(random.integers(1, 256))
        (tmp_path / "flipped").write_bytes(flipped)
        with pytest.raises(StrategyError):
            load_networks(tmp_path / "flipped")


class Bomb:
    """Ends the test where it is unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("the file was unpickled",))


def pickled() -> bytes:
    content = io.BytesIO()
    np.save(content, np.array([Bomb()], dtype=object), allow_pickle=True)
    return content.getvalue()


def cut(part: float):
    return lambda whole: whole[: int(part * len(whole))]


STRANGE = {
    **{f"{part} of it": cut(part) for part in (0.0, 1e-5, 0.002, 0.1, 0.5, 0.999)},
    "noise": lambda _: np.random.default_rng(0).bytes(4000),
    "a pickle": lambda _: pickled(),
    "of another program": lambda _: save({"weights": np.zeros(3, np.float32)}),
    "longer than it says": lambda whole: whole + b"\0",
    "a header too large": lambda _: (10**8).to_bytes(8, "little") + b" " * 100,
    **{
        f"metadata {text}": lambda _, text=text: save(
            {"weights": np.zeros(3, np.float32)},
            metadata={"s2c2a": text, "digest": "0" * 64},
        )
        for text in ("[1]", "{", "null", '"paper"')
    },
}


@pytest.mark.parametrize("change", STRANGE.values(), ids=STRANGE)
def test_content_that_is_no_strategy_is_refused(strategy_file, tmp_path, change):
    (tmp_path / "strange").write_bytes(change(strategy_file.read_bytes()))
    with pytest.raises(StrategyError, match="is no strategy file, or damaged"):
        load_networks(tmp_path / "strange")


BIAS = "C2S.network.bias_head"


def bias(value, size=6, kind=np.float32) -> dict:
    return {BIAS: np.full(size, value, kind)}


@pytest.mark.parametrize(
    ("metadata", "without", "arrays", "message"),
    [
        ({}, BIAS, {}, "bias_head"),
        ({}, "C2A.network.layers[0][1].weight_hidden", {}, "weight_hidden"),
        ({}, "", bias(0.0, size=7), r"bias_head of shape \(6,\)"),
        ({}, "", bias(0, kind=np.int32), "bias_head"),
        # they would drive the arm with NaN, or to its limits at once
        *(({}, "", bias(value), "bias_head") for value in (np.nan, np.inf, -np.inf)),
        *(({}, "", bias(value), "bias_head") for value in (1e20, -1e7)),
        *(({}, key, {}, "damaged") for key in ("arm", "recipe", "seed", "percent")),
        *(({}, f"curve.{name}", {}, "damaged") for name in ("C2S", "C2A")),
        ({}, "", {"curve.C2S": np.zeros((3, 2))}, "curve"),
        ({}, "", {"curve.C2S": np.zeros(3)}, "curve"),
        ({}, "", {"curve.C2S": np.full((3, 3), np.nan)}, "curve"),
        ({}, "", {f"more{n}": np.zeros(1) for n in range(20_000)}, "header"),
        ({"arm": "name ="}, "", {}, "arm in"),
        ({"percent": {}}, "", {}, "damaged"),
        ({"percent": {"C2S": [1.0, 1.0]}}, "", {}, "damaged"),
        (
            {"percent": {"C2S": [float("nan"), 1.0], "C2A": [1.0, 1.0]}},
            "",
            {},
            "damaged",
        ),
    ],
)
def test_what_is_missing_or_not_sound_is_refused(
    rewrite, metadata, without, arrays, message
):
    left_out = (without,) if without else ()
    with pytest.raises(StrategyError, match=message):
        load_networks(rewrite(metadata, left_out, **arrays))


def test_no_module_is_imported_because_a_file_names_it(
    rewrite, strategy_file, tmp_path, monkeypatch
):
    (tmp_path / "trap.py").write_text("raise SystemExit('the file was believed')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    recipe = contents(strategy_file)[1]["recipe"]
    for name in ("trap:Anything", "trap.py:Anything", "trap"):
        with pytest.raises(StrategyError, match="files cannot run code"):
            load_networks(rewrite({"recipe": recipe | {"c2s": {"model": name}}}))
    assert "trap" not in sys.modules
