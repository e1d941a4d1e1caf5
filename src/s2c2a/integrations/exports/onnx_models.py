"""Export form `onnx`: the biLSTMs of a trained strategy as ONNX models."""

from pathlib import Path
from typing import Any

import s2c2a
from s2c2a.arm import arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.files.text import atomic_write
from s2c2a.integrations.extras import needs_extra
from s2c2a.models import C2A, C2S
from s2c2a.strategies import load_networks


def export_onnx(file: Path, out: Path) -> str:
    """Write the networks of weights as ONNX models.

    Args:
        file: weights, such as mine.safetensors.
        out: begins their names: mine.onnx stands for mine.forward_model.onnx and
            mine.controller.onnx.

    Returns:
        What was written.

    Raises:
        S2C2AError: no weight file, the extra is missing, or a network is no biLSTM; the
            other is written.
    """
    trained = load_networks(file)
    with needs_extra("onnx", "an export to ONNX"):
        from s2c2a.integrations.exports import onnx_graphs  # noqa: PLC0415  # an extra

    texts = {
        "arm": arm_to_toml(trained.arm),
        "control_period": f"{trained.arm.control_period:g}",
        "origin": f"{file.name}, S2C2A {s2c2a.__version__}",
    }
    kinds: dict[str, tuple[str, type, Any]] = {
        "forward_model": ("C2S", C2S, onnx_graphs.forward_graph),
        "controller": ("C2A", C2A, onnx_graphs.controller_graph),
    }
    written = []
    faults = []
    for name, (part, kind, graph_of) in kinds.items():
        network = trained.networks.get(part)
        if not isinstance(network, kind):
            found = type(network).__name__ if part in trained.networks else "missing"
            faults.append(f"{name}: its network {part} is {found}, no biLSTM")
            continue
        model = graph_of(network, trained.arm).model(f"s2c2a_{name}", texts)
        with atomic_write(out.with_suffix(f".{name}.onnx")) as unfinished:
            unfinished.write_bytes(model)
        written.append(name)
    if faults:
        raise S2C2AError(
            f"these models were not written: {'; '.join(faults)}. --to c exports the "
            f"whole control step. Written: {', '.join(written) or 'none'}"
        )
    return f"models {', '.join(written)}"
