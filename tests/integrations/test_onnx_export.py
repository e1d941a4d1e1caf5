import jax
import numpy as np
import onnx
import pytest

from s2c2a.arm import arm_from_toml, load_arm
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports import onnx_models
from s2c2a.integrations.exports.onnx_models import (
    check_model,
    export_onnx,
    onnx_of,
    parts_of,
    runner,
)
from s2c2a.strategies import networks_from, save_networks, strategy_of
from s2c2a.strategies.pcc import pcc_strategy

from tools.c_step import EQUAL, onnx_differences

STEPS = 150


@pytest.fixture(scope="module")
def strategy():
    return pcc_strategy(load_arm("planar_finger"))


@pytest.fixture(scope="module")
def models(strategy, tmp_path_factory):
    """Names and bytes of the models that are exported."""
    folder = tmp_path_factory.mktemp("models")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(onnx_models, "strategy_in", lambda file: strategy)
        text = export_onnx(folder / "any.safetensors", folder / "mine.onnx")
    assert text == "models start, control_step, forward_model, controller"
    return {
        path.name.split(".")[1]: path.read_bytes() for path in folder.glob("mine.*")
    }


def test_the_models_are_valid_and_name_their_units(strategy, models):
    for content in models.values():
        model = onnx.load_from_string(content)
        onnx.checker.check_model(model, full_check=True)
        texts = {each.key: each.value for each in model.metadata_props}
        assert arm_from_toml(texts["arm"], "arm") == strategy.arm
    step = onnx.load_from_string(models["control_step"]).graph
    about = {each.name: each.doc_string for each in [*step.input, *step.output]}
    assert about["measured_cables"] == "displacements of the cables [m]"
    assert about["command"] == "command of every cable [m or N], base first"


@pytest.mark.slow
def test_recorded_steps_in_onnx_are_those_of_jax(strategy):
    differences, _ = onnx_differences(strategy, STEPS)
    assert len(differences) == STEPS
    assert differences.max() < EQUAL


@pytest.mark.slow
def test_recorded_steps_of_the_shipped_networks_in_onnx_are_those_of_jax():
    strategy = strategy_of(networks_from("shipped", load_arm("twin_arm")))
    differences, _ = onnx_differences(strategy, 1000)
    assert np.median(differences) < 1e-6
    # where a decision hangs on the last bits, both may decide otherwise
    assert (differences > EQUAL).sum() <= 5


@pytest.mark.slow
def test_the_shipped_networks_are_exported(tmp_path):
    arm = load_arm("twin_arm")
    weights = tmp_path / "mine.safetensors"
    save_networks(networks_from("shipped", arm), weights)
    export_onnx(weights, tmp_path / "mine.onnx")
    model = onnx.load(tmp_path / "mine.controller.onnx")
    inputs = [each.name for each in model.graph.input]
    assert "memory_inner_actions" in inputs


def test_inputs_of_the_goal_and_missing_measurements_may_be_left_out(models):
    first = runner(models["start"])
    cables = {"measured_cables": np.zeros((2, 2), np.float32)}
    memory = first(cables)
    graph = onnx.load_from_string(models["start"]).graph
    names = [each.name for each in graph.output]
    inputs = cables | dict(zip(names, memory, strict=True))
    command, *after = runner(models["control_step"])(inputs)
    assert np.isfinite(command).all()
    assert len(after) == len(memory)


def test_a_model_that_differs_from_jax_is_refused(strategy):
    predict = parts_of(strategy)[2]
    model = onnx_of(predict, {})

    def doubled(**inputs):
        return jax.tree.map(lambda values: 2.0 * values, predict.function(**inputs))

    with pytest.raises(S2C2AError, match=r"differs from JAX by .* Use --to c"):
        check_model(predict._replace(function=doubled), model)


def unknown(**inputs):
    return {"states": jax.numpy.linalg.eigh(jax.numpy.eye(2) * inputs["x"])[1]}


def broken(**inputs):
    raise RuntimeError("no eigh")


@pytest.mark.parametrize("function", [unknown, broken])
def test_one_model_that_cannot_be_written_does_not_lose_the_others(
    strategy, tmp_path, monkeypatch, function
):
    _, _, model, controller = parts_of(strategy)
    x = {"x": np.ones(2, np.float32)}
    strange = model._replace(name="strange", function=function, inputs=x)
    monkeypatch.setattr(onnx_models, "strategy_in", lambda file: strategy)
    monkeypatch.setattr(onnx_models, "parts_of", lambda _: [strange, controller])
    with pytest.raises(S2C2AError, match=r"strange: .*eigh.*Written: controller"):
        export_onnx(tmp_path / "any.safetensors", tmp_path / "mine.onnx")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.controller.onnx"]
