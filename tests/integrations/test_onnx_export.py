"""ONNX models of the networks: ONNX Runtime computes what JAX computes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import arm_from_toml, load_arm
from s2c2a.control.controllers import NetworkController
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.onnx_models import export_onnx
from s2c2a.kinematics import configurations_from_bends
from s2c2a.paper import Scaling
from s2c2a.strategies import networks_from, recipe_named, save_networks
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import Trained

onnx = pytest.importorskip("onnx")
runtime = pytest.importorskip("onnxruntime")
RANDOM = np.random.default_rng(0)


def configurations(modules):
    bends = RANDOM.uniform(-1.0, 1.0, (modules, 2))
    return configurations_from_bends(jnp.asarray(bends, jnp.float32))


def scaling(features):
    """Neither of its numbers is one of the identity."""
    return Scaling.of(RANDOM.normal(size=(9, features)))


@pytest.fixture(params=["twin_arm", "planar_finger", "pneumatic_arm"])
def exported(request, tmp_path):
    """Untrained networks with scalings, and a function that runs a model of theirs."""
    arm = load_arm(request.param)
    recipe = recipe_named("paper")
    networks = dict(recipe.untrained(arm, jax.random.key(0)))
    for name, network in networks.items():
        replaced = {"configuration_scaling": scaling(3)}
        if name == "C2S":
            replaced["state_scaling"] = scaling(6)
        networks[name] = network.__class__(**{**vars(network), **replaced})
    trained = {name: Trained(network) for name, network in networks.items()}
    save_networks(
        TrainedNetworks(arm, recipe, 0, trained), tmp_path / "mine.safetensors"
    )
    text = export_onnx(tmp_path / "mine.safetensors", tmp_path / "mine.onnx")
    assert text == "models forward_model, controller"

    def run(name, inputs):
        file = tmp_path / f"mine.{name}.onnx"
        onnx.checker.check_model(str(file), full_check=True)
        model = onnx.load(file)
        texts = {each.key: each.value for each in model.metadata_props}
        assert arm_from_toml(texts["arm"], "arm") == arm
        assert all(
            each.doc_string for each in [*model.graph.input, *model.graph.output]
        )
        session = runtime.InferenceSession(file)
        names = [each.name for each in session.get_outputs()]
        return dict(zip(names, session.run(None, inputs), strict=True))

    return arm, networks, run


def test_the_forward_model_is_that_of_jax(exported):
    arm, networks, run = exported
    given = configurations(arm.module_count)
    found = run("forward_model", {"configurations": np.asarray(given)})
    expected = networks["C2S"].predict(given, ())
    np.testing.assert_allclose(found["states"], expected, rtol=1e-5, atol=1e-6)


def test_the_controller_and_its_memory_are_those_of_jax(exported):
    arm, networks, run = exported
    controller = NetworkController(networks["C2A"])
    memory = controller.start(configurations(arm.module_count))
    for _ in range(6):  # as long as the longest history
        desired = configurations(arm.module_count)
        sensed = configurations(arm.module_count)
        found = run(
            "controller",
            {
                "desired": np.asarray(desired),
                "sensed": np.asarray(sensed),
                "memory_configurations": np.asarray(memory.configurations),
                "memory_actions": np.asarray(memory.actions),
            },
        )
        command, memory = controller.act(desired, sensed, memory)
        scale = float(np.abs(command).max())
        np.testing.assert_allclose(found["command"], command, atol=1e-5 * scale)
        for name, expected in memory._asdict().items():
            np.testing.assert_allclose(
                found[f"memory_{name}_out"], expected, rtol=1e-5, atol=1e-5
            )


def test_what_is_no_bilstm_is_named_with_the_way_out_and_the_other_is_written(tmp_path):
    weights = tmp_path / "mine.safetensors"
    save_networks(networks_from("shipped", load_arm("twin_arm")), weights)
    with pytest.raises(
        S2C2AError, match=r"C2S is LocalC2S, no biLSTM.*--to c .*Written: controller$"
    ):
        export_onnx(weights, tmp_path / "mine.onnx")
    assert [path.name for path in tmp_path.glob("*.onnx")] == ["mine.controller.onnx"]
