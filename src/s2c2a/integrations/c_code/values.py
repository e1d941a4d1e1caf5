"""Arrays in generated code: places in memory, and expressions that are not stored."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from typing import Literal, Self

Kind = Literal["float", "int32_t"]
"""Types of C; truth values are integers."""
Shape = tuple[int, ...]
Indices = tuple[str, ...]


@dataclass(frozen=True)
class Place:
    """An array in the workspace that is reused after its last use.

    Attributes:
        kind: of its elements.
        start: first element.
        size: number of elements.
    """

    kind: Kind
    start: int
    size: int


@dataclass(frozen=True)
class Value(ABC):
    """An array that code reads.

    Attributes:
        kind: of its elements.
        shape: of the array.
    """

    kind: Kind
    shape: Shape

    cost: int = field(default=0, kw_only=True)
    """Operations in the expression of an element."""
    places: frozenset[Place] = field(default=frozenset(), kw_only=True)
    """Parts of the workspace that it reads."""

    @abstractmethod
    def at(self, indices: Indices) -> str:
        """C expression of an element."""

    @abstractmethod
    def broadcast(self, shape: Shape, axes: Sequence[int | None]) -> Self:
        """The array with other axes.

        Args:
            shape: of the result; axes of one element are repeated.
            axes: where each axis is in the result; None for one element, which is left
                out.
        """

    @abstractmethod
    def sliced(self, starts: Sequence[int], shape: Shape, steps: Sequence[int]) -> Self:
        """Every n-th element along each axis."""

    def permuted(self, axes: Sequence[int]) -> Self:
        """The array with its axes in another order."""
        shape = tuple(self.shape[axis] for axis in axes)
        return self.broadcast(shape, [axes.index(axis) for axis in range(len(axes))])

    def without(self, axes: Sequence[int]) -> Self:
        """The array without axes of one element."""
        kept = [axis for axis in range(len(self.shape)) if axis not in axes]
        shape = tuple(self.shape[axis] for axis in kept)
        places = {axis: place for place, axis in enumerate(kept)}
        return self.broadcast(
            shape, [places.get(axis) for axis in range(len(self.shape))]
        )


@dataclass(frozen=True)
class Stored(Value):
    """An array in memory, or a view of one.

    Attributes:
        base: C expression of a pointer.
        strides: elements between neighbors along each axis.
        offset: of the first element from the pointer, a C expression.
    """

    base: str
    strides: tuple[int, ...]
    offset: str = "0"

    @classmethod
    def contiguous(
        cls,
        kind: Kind,
        shape: Shape,
        base: str,
        offset: str = "0",
        places: frozenset[Place] = frozenset(),
    ) -> "Stored":
        """A whole array, last axis fastest."""
        strides = contiguous_strides(shape)
        return cls(kind, shape, base, strides, offset, places=places)

    @property
    def is_contiguous(self) -> bool:
        """Whether the elements are in order, without gaps."""
        needed = contiguous_strides(self.shape)
        rows = zip(self.shape, self.strides, needed, strict=True)
        return all(size == 1 or stride == need for size, stride, need in rows)

    def at(self, indices: Indices) -> str:
        parts = [] if self.offset == "0" else [self.offset]
        for index, stride in zip(indices, self.strides, strict=True):
            if stride and index != "0":
                parts.append(index if stride == 1 else f"{index} * {stride}")
        return f"{self.base}[{' + '.join(parts) or '0'}]"

    def broadcast(self, shape: Shape, axes: Sequence[int | None]) -> "Stored":
        strides = [0] * len(shape)
        for axis, size, stride in zip(axes, self.shape, self.strides, strict=True):
            if axis is not None and size == shape[axis]:
                strides[axis] = stride
        return replace(self, shape=shape, strides=tuple(strides))

    def sliced(
        self, starts: Sequence[int], shape: Shape, steps: Sequence[int]
    ) -> "Stored":
        pairs = zip(starts, self.strides, strict=True)
        moved = sum(start * stride for start, stride in pairs)
        strides = zip(self.strides, steps, strict=True)
        return replace(
            self,
            shape=shape,
            strides=tuple(stride * step for stride, step in strides),
            offset=plus(self.offset, moved),
        )


@dataclass(frozen=True)
class Computed(Value):
    """An array of which each element is computed where it is used.

    Attributes:
        element: indices -> C expression.
    """

    element: Callable[[Indices], str]

    def at(self, indices: Indices) -> str:
        return self.element(indices)

    def broadcast(self, shape: Shape, axes: Sequence[int | None]) -> "Computed":
        def element(to: Indices) -> str:
            indices = []
            for axis, size in zip(axes, self.shape, strict=True):
                if axis is None or size != shape[axis]:
                    indices.append("0")
                else:
                    indices.append(to[axis])
            return self.element(tuple(indices))

        return replace(self, shape=shape, element=element)

    def sliced(
        self, starts: Sequence[int], shape: Shape, steps: Sequence[int]
    ) -> "Computed":
        def element(to: Indices) -> str:
            rows = zip(to, starts, steps, strict=True)
            return self.element(tuple(linear(*row) for row in rows))

        return replace(self, shape=shape, element=element)


def contiguous_strides(shape: Shape) -> tuple[int, ...]:
    """Strides of an array whose last axis is the fastest."""
    return tuple(prod(shape[axis + 1 :]) for axis in range(len(shape)))


def plus(expression: str, number: int) -> str:
    """C expression of a sum."""
    if not number:
        return expression
    if expression.lstrip("-").isdigit():
        return str(int(expression) + number)
    return f"{expression} + {number}"


def linear(index: str, start: int, step: int) -> str:
    """C expression of `start + step * index`."""
    if index == "0":
        return str(start)
    scaled = index if step == 1 else f"{index} * {step}"
    return scaled if not start else f"({start} + {scaled})"
