"""Windows of an array that a gather reads or a scatter writes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from s2c2a.integrations.c_code.jaxprs import described, other_axes


class WindowAxes(NamedTuple):
    """What the axes of an array and of the elements of its windows mean.

    Attributes:
        starts: axes of the array that the starts of windows count along.
        batch: axes of the elements that count windows.
        windows: axis of the array -> axis of the elements, inside a window.
        shared: axis of the array -> axis of the elements, along which the array has
            its own part for each index.
    """

    starts: Sequence[int]
    batch: Sequence[int]
    windows: dict[int, int]
    shared: dict[int, int]

    @property
    def matched(self) -> dict[int, int]:
        """Axis of the array -> axis of the elements."""
        return self.windows | self.shared


def axes_of_gather(equation: Any) -> WindowAxes:
    """Axes of a gather, whose elements are the result."""
    numbers = equation.params["dimension_numbers"]
    array = described(equation.invars[0])
    elements = described(equation.outvars[0])
    return _window_axes(
        len(array.shape),
        len(elements.shape),
        numbers.start_index_map,
        numbers.collapsed_slice_dims,
        numbers.offset_dims,
        numbers.operand_batching_dims,
        numbers.start_indices_batching_dims,
    )


def axes_of_scatter(equation: Any) -> WindowAxes:
    """Axes of a scatter, whose elements are the updates."""
    numbers = equation.params["dimension_numbers"]
    array = described(equation.invars[0])
    elements = described(equation.invars[2])
    return _window_axes(
        len(array.shape),
        len(elements.shape),
        numbers.scatter_dims_to_operand_dims,
        numbers.inserted_window_dims,
        numbers.update_window_dims,
        numbers.operand_batching_dims,
        numbers.scatter_indices_batching_dims,
    )


def _window_axes(
    rank: int,
    elements_rank: int,
    starts: Sequence[int],
    dropped: Sequence[int],
    inside: Sequence[int],
    array_batches: Sequence[int],
    index_batches: Sequence[int],
) -> WindowAxes:
    batch = other_axes(elements_rank, inside)
    kept = other_axes(rank, (*dropped, *array_batches))
    windows = dict(zip(kept, inside, strict=True))
    shared = {}
    for axis, index_axis in zip(array_batches, index_batches, strict=True):
        shared[axis] = batch[index_axis]
    return WindowAxes(starts, batch, windows, shared)


def sizes_of_scatter(equation: Any, axes: WindowAxes) -> list[int]:
    """Sizes of the windows that a scatter writes, along all axes of the array."""
    array = described(equation.invars[0])
    updates = described(equation.invars[2])
    sizes = [1] * len(array.shape)
    for axis, element_axis in axes.windows.items():
        sizes[axis] = updates.shape[element_axis]
    return sizes
