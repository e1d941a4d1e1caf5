"""Arrays in generated code: places in memory, and expressions that are not stored."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Literal

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
class Stored:
    """An array in memory, or a view of one.

    Attributes:
        kind: of its elements.
        shape: of the array.
        base: C expression of a pointer.
        offset: of the first element from the pointer, a C expression.
        strides: elements between neighbors along each axis.
        places: parts of the workspace that it reads.
    """

    kind: Kind
    shape: Shape
    base: str
    strides: tuple[int, ...]
    offset: str = "0"
    places: frozenset[Place] = frozenset()

    cost = 0

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
        return cls(kind, shape, base, contiguous_strides(shape), offset, places)

    @property
    def is_contiguous(self) -> bool:
        """Whether the elements are in order, without gaps."""
        needed = contiguous_strides(self.shape)
        pairs = zip(self.shape, self.strides, needed, strict=True)
        return all(size == 1 or stride == need for size, stride, need in pairs)

    @property
    def pointer(self) -> str:
        """C expression of a pointer to the first element."""
        return self.base if self.offset == "0" else f"({self.base} + {self.offset})"

    def at(self, indices: Indices) -> str:
        """C expression of an element."""
        parts = [] if self.offset == "0" else [self.offset]
        for index, stride in zip(indices, self.strides, strict=True):
            if stride and index != "0":
                parts.append(index if stride == 1 else f"{index} * {stride}")
        return f"{self.base}[{' + '.join(parts) or '0'}]"

    def permuted(self, axes: Sequence[int]) -> "Stored":
        """The array with its axes in another order."""
        shape = tuple(self.shape[axis] for axis in axes)
        strides = tuple(self.strides[axis] for axis in axes)
        return replace(self, shape=shape, strides=strides)

    def broadcast(self, shape: Shape, axes: Sequence[int]) -> "Stored":
        """The array with new axes, and axes of one element repeated."""
        strides = [0] * len(shape)
        for axis, size, stride in zip(axes, self.shape, self.strides, strict=True):
            strides[axis] = stride if size == shape[axis] else 0
        return replace(self, shape=shape, strides=tuple(strides))

    def sliced(
        self, starts: Sequence[int], shape: Shape, steps: Sequence[int]
    ) -> "Stored":
        """Every n-th element along each axis."""
        pairs = zip(starts, self.strides, strict=True)
        moved = sum(start * stride for start, stride in pairs)
        strides = zip(self.strides, steps, strict=True)
        return replace(
            self,
            shape=shape,
            strides=tuple(stride * step for stride, step in strides),
            offset=plus(self.offset, moved),
        )

    def without(self, axes: Sequence[int]) -> "Stored":
        """The array without axes of one element."""
        kept = [axis for axis in range(len(self.shape)) if axis not in axes]
        return self.permuted(kept)


@dataclass(frozen=True)
class Computed:
    """An array of which each element is computed where it is used.

    Attributes:
        kind: of its elements.
        shape: of the array.
        element: indices -> C expression.
        cost: operations in the expression.
        places: parts of the workspace that it reads.
    """

    kind: Kind
    shape: Shape
    element: Callable[[Indices], str]
    cost: int = 0
    places: frozenset[Place] = frozenset()

    def at(self, indices: Indices) -> str:
        """C expression of an element."""
        return self.element(indices)

    def permuted(self, axes: Sequence[int]) -> "Computed":
        """The array with its axes in another order."""
        back = [axes.index(axis) for axis in range(len(axes))]
        shape = tuple(self.shape[axis] for axis in axes)
        return self._viewed(shape, lambda to: tuple(to[axis] for axis in back))

    def broadcast(self, shape: Shape, axes: Sequence[int]) -> "Computed":
        """The array with new axes, and axes of one element repeated."""
        sizes = dict(zip(axes, self.shape, strict=True))

        def source(to: Indices) -> Indices:
            return tuple(
                to[axis] if size == shape[axis] else "0" for axis, size in sizes.items()
            )

        return self._viewed(shape, source)

    def sliced(
        self, starts: Sequence[int], shape: Shape, steps: Sequence[int]
    ) -> "Computed":
        """Every n-th element along each axis."""

        def source(to: Indices) -> Indices:
            rows = zip(to, starts, steps, strict=True)
            return tuple(linear(index, start, step) for index, start, step in rows)

        return self._viewed(shape, source)

    def without(self, axes: Sequence[int]) -> "Computed":
        """The array without axes of one element."""
        kept = [axis for axis in range(len(self.shape)) if axis not in axes]

        def source(to: Indices) -> Indices:
            indices = ["0"] * len(self.shape)
            for axis, index in zip(kept, to, strict=True):
                indices[axis] = index
            return tuple(indices)

        return self._viewed(tuple(self.shape[axis] for axis in kept), source)

    def _viewed(self, shape: Shape, source: Callable[[Indices], Indices]) -> "Computed":
        return replace(self, shape=shape, element=lambda to: self.element(source(to)))


Value = Stored | Computed


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
