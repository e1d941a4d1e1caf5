"""The paper's networks in PyTorch with the weights of the JAX networks.

Needs PyTorch; the extra `bench` brings it.
"""

import numpy as np
import torch
from torch import Tensor, nn

from s2c2a.models import C2A, C2S
from s2c2a.models.layers import Scaling, SumAndRange
from s2c2a.paper import BiLSTM, module_labels


class TorchBiLSTM(nn.Module):
    """PyTorch's form of `BiLSTM`: transposed weights, and a second bias of zero."""

    def __init__(self, network: BiLSTM):
        super().__init__()
        features, gates = network.layers[0][0].weight_input.shape
        outputs = network.weight_head.shape[1]
        self.lstm = nn.LSTM(
            features,
            gates // 4,
            len(network.layers),
            batch_first=True,
            bidirectional=True,
        )
        self.head = nn.Linear(network.weight_head.shape[0], outputs)
        self.load_state_dict(state_of(network))

    def forward(self, inputs: Tensor) -> Tensor:
        """Outputs of every module, shape (batch, modules, outputs)."""
        return self.head(self.lstm(inputs)[0])


def state_of(network: BiLSTM) -> dict[str, Tensor]:
    """The weights by PyTorch's names."""
    state = {
        "head.weight": tensor(network.weight_head.T),
        "head.bias": tensor(network.bias_head),
    }
    for number, directions in enumerate(network.layers):
        for direction, ending in zip(directions, ("", "_reverse"), strict=True):
            place = f"_l{number}{ending}"
            state |= {
                f"lstm.weight_ih{place}": tensor(direction.weight_input.T),
                f"lstm.weight_hh{place}": tensor(direction.weight_hidden.T),
                f"lstm.bias_ih{place}": tensor(direction.bias),
                f"lstm.bias_hh{place}": tensor(np.zeros(direction.bias.shape)),
            }
    return state


class TorchScaling:
    """`Scaling` on tensors."""

    def __init__(self, scaling: Scaling):
        self.center = tensor(scaling.center)
        self.half_range = tensor(scaling.half_range)

    def forward(self, values: Tensor) -> Tensor:
        """To [-1, 1]."""
        return (values - self.center) / self.half_range

    def back(self, values: Tensor) -> Tensor:
        """From [-1, 1]."""
        return values * self.half_range + self.center


class TorchC2S(nn.Module):
    """`C2S` as PyTorch has it."""

    def __init__(self, model: C2S):
        super().__init__()
        self.network = TorchBiLSTM(model.network)
        self.configuration_scaling = TorchScaling(model.configuration_scaling)
        self.state_scaling = TorchScaling(model.state_scaling)

    def forward(self, configurations: Tensor) -> Tensor:
        """States [m, 1], shape (batch, modules, 6), base frame."""
        return self.state_scaling.back(
            self.network(self.configuration_scaling.forward(configurations))
        )


class TorchSumAndRange:
    """`SumAndRange` on tensors."""

    def __init__(self, layer: SumAndRange):
        self.evenly_three = layer.evenly_three
        self.matrices = tensor(layer.matrices)
        self.inverses = tensor(layer.pseudo_inverses)
        self.low = tensor((layer.low - layer.neutral) / layer.unit)
        self.high = tensor((layer.high - layer.neutral) / layer.unit)

    def __call__(self, raw: Tensor) -> Tensor:
        """Normalized actions within the arm's limits."""
        return torch.clamp(self._unlimited(raw), self.low, self.high)

    def _unlimited(self, raw: Tensor) -> Tensor:
        if self.evenly_three:
            squashed = torch.tanh(raw)
            return (3.0 * squashed - squashed.sum(-1, keepdim=True)) / 4.0
        desired = torch.einsum("mkc,...mc->...mk", self.inverses, raw)
        length = torch.linalg.norm(desired, dim=-1, keepdim=True).clamp(min=1e-6)
        return torch.einsum(
            "mck,...mk->...mc", self.matrices, desired * torch.tanh(length) / length
        )


class TorchC2A(nn.Module):
    """`C2A` as PyTorch has it."""

    def __init__(self, model: C2A):
        super().__init__()
        self.network = TorchBiLSTM(model.network)
        self.configuration_scaling = TorchScaling(model.configuration_scaling)
        self.layer = TorchSumAndRange(model.sum_and_range)
        self.labels = tensor(module_labels(len(model.sum_and_range.neutral)))[:, None]

    def forward(
        self, desired: Tensor, configurations: Tensor, actions: Tensor
    ) -> Tensor:
        """Normalized actions, shape (batch, modules, cables)."""
        parts = [
            self.configuration_scaling.forward(desired),
            self.configuration_scaling.forward(configurations).flatten(-2),
            actions.flatten(-2),
            self.labels.expand(*desired.shape[:-1], 1),
        ]
        return self.layer(self.network(torch.cat(parts, dim=-1)))


def tensor(values) -> Tensor:
    """A tensor of its own, single precision."""
    return torch.tensor(np.array(values, np.float32))
