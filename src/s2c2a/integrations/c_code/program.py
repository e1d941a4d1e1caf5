"""A function in C as it is written: statements, workspace and constants."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import prod

import numpy as np

from s2c2a.integrations.c_code.values import (
    Computed,
    Indices,
    Kind,
    Place,
    Shape,
    Stored,
    Value,
)

WORKSPACES: dict[Kind, str] = {"float": "w", "int32_t": "k"}
"""Names of the workspaces in generated code, by type."""
PART = 150  # statements of one C function; compilers take long over large ones


@dataclass
class Workspace:
    """Places of one type; a place is reused when its array is dead.

    Attributes:
        size: number of elements that were ever needed.
    """

    kind: Kind
    size: int = 0
    taken: set[Place] = field(default_factory=set)

    def take(self, size: int) -> Place:
        """The first gap that is large enough."""
        start = 0
        for place in sorted(self.taken, key=lambda place: place.start):
            if place.start - start >= size:
                break
            start = place.start + place.size
        place = Place(self.kind, start, size)
        self.taken.add(place)
        self.size = max(self.size, start + size)
        return place


class Constants:
    """Arrays that never change, each written once."""

    def __init__(self, prefix: str):
        """No constants yet; their names begin with the prefix."""
        self._prefix = prefix
        self._names: dict[tuple, str] = {}
        self._arrays: dict[str, np.ndarray] = {}

    def stored(self, values: np.ndarray) -> Stored:
        """The array as a constant."""
        values = np.asarray(values)
        kind = kind_of(values.dtype)
        stored = values.astype(np.float32 if kind == "float" else np.int32)
        key = (kind, stored.tobytes())
        if key not in self._names:
            self._names[key] = f"{self._prefix}_c{len(self._names)}"
            self._arrays[self._names[key]] = stored.reshape(-1)
        return Stored.contiguous(kind, values.shape, self._names[key])

    def used_in(self, code: str) -> dict[str, np.ndarray]:
        """The constants that code reads, by name."""
        words = set(re.findall(rf"\b{self._prefix}_c\d+\b", code))
        return {name: array for name, array in self._arrays.items() if name in words}


class Program:
    """Statements of one C function, and the places of their arrays.

    Attributes:
        constants: shared by the functions of a file.
        workspaces: by type.
    """

    def __init__(self, name: str, constants: Constants, parameters: str):
        """An empty function.

        Args:
            name: of the C function.
            constants: that it may use.
            parameters: of the function besides its workspaces, such as
                "const float *x".
        """
        self.name = name
        self.constants = constants
        self.workspaces = {kind: Workspace(kind) for kind in WORKSPACES}
        self._parameters = parameters
        self._statements: list[str] = []
        self._functions: list[str] = []
        self._loops: list[str] = []
        self._names = 0

    def new_array(self, kind: Kind, shape: Shape) -> Stored:
        """A new array in the workspace."""
        place = self.workspaces[kind].take(max(prod(shape), 1))
        base = WORKSPACES[kind]
        return Stored.contiguous(
            kind, shape, base, str(place.start), frozenset({place})
        )

    def free_all_but(self, live: frozenset[Place]) -> None:
        """Release the places that no live value reads."""
        for workspace in self.workspaces.values():
            workspace.taken &= live

    def add(self, statement: str) -> None:
        """Append a statement, unless it is empty."""
        if statement:
            self._statements.append(statement)

    def new_name(self, prefix: str) -> str:
        """A name that is used nowhere else in the function."""
        self._names += 1
        return f"{prefix}{self._names}"

    @contextmanager
    def body(self, loop: str | None = None) -> Iterator[list[str]]:
        """Collect the statements of the block as a C function of its own.

        Args:
            loop: name of the index of the loop around it.

        Yields:
            A list that holds the call of the function after the block.
        """
        outer = self._statements
        self._statements = []
        if loop:
            self._loops.append(loop)
        call: list[str] = []
        try:
            yield call
            call.append(self._call_of(self._statements))
        finally:
            self._statements = outer
            if loop:
                self._loops.pop()

    def assign(self, target: Stored, value: Value) -> None:
        """Copy or compute all elements of a value."""
        indices = index_names(target.shape)
        element = f"{target.at(indices)} = {value.at(indices)};"
        self.add(looped(target.shape, indices, element))

    def copied(self, value: Value) -> Stored:
        """The value in an array of its own, which other operations may change."""
        array = self.new_array(value.kind, value.shape)
        self.assign(array, value)
        return array

    def stored(self, value: Value) -> Stored:
        """The value in memory: a view stays where it is."""
        return value if isinstance(value, Stored) else self.copied(value)

    def contiguous(self, value: Value) -> Stored:
        """The value in memory, in order."""
        if isinstance(value, Stored) and value.is_contiguous:
            return value
        return self.copied(value)

    def text(self) -> str:
        """The C functions, the one of the program last."""
        call = self._call_of(self._statements)
        head = f"static void {self.name}({self._arguments(())})"
        return "\n\n".join([*self._functions, f"{head}\n{{\n{call}\n}}"])

    def _call_of(self, statements: list[str]) -> str:
        """Statements that call functions of at most `PART` statements each."""
        calls = []
        for first in range(0, len(statements), PART):
            part = self.new_name(f"{self.name}_p")
            loops = tuple(self._loops)
            content = "\n".join(statements[first : first + PART])
            unused = "".join(f" (void){loop};" for loop in loops)
            given = " ".join(f"(void){name};" for name in self._given())
            head = f"static void {part}({self._arguments(loops)})"
            self._functions.append(f"{head}\n{{\n{given}{unused}\n{content}\n}}")
            calls.append(f"{part}({', '.join([*self._given(), *loops])});")
        return "\n".join(calls)

    def _given(self) -> list[str]:
        parameters = self._parameters.split(",")
        names = [parameter.split("*")[-1].strip() for parameter in parameters]
        return [*WORKSPACES.values(), *names]

    def _arguments(self, loops: tuple[str, ...]) -> str:
        spaces = [f"{kind} *{name}" for kind, name in WORKSPACES.items()]
        indices = [f"int {loop}" for loop in loops]
        return ", ".join([*spaces, self._parameters, *indices])


def definition(name: str, values: np.ndarray) -> str:
    """A constant array in C."""
    numbers = ", ".join(literal(number) for number in values)
    kind = kind_of(values.dtype)
    return f"static const {kind} {name}[{values.size}] = {{{numbers}}};"


def kind_of(dtype: np.dtype) -> Kind:
    """The type in C: single precision, or 32-bit integers, also for truth values."""
    return "float" if np.issubdtype(dtype, np.floating) else "int32_t"


def literal(value: float | int | np.number | np.bool_) -> str:
    """A number in C, exact in single precision."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(int(value))
    number = np.float32(value)
    if np.isnan(number):
        return "NAN"
    if np.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return f"{number!s}f"  # the fewest digits that tell it from its neighbors


def constant(value: float | int | np.number | np.bool_, kind: Kind) -> Computed:
    """A single number that needs no memory."""
    number = float(value) if kind == "float" else int(value)
    text = literal(number)
    if text.startswith("-"):
        text = f"({text})"
    return Computed(kind, (), lambda indices: text)


def index_names(shape: Shape, letter: str = "i") -> Indices:
    """Names of the loop indices of an array; "0" where there is one element."""
    return tuple(
        f"{letter}{axis}" if size != 1 else "0" for axis, size in enumerate(shape)
    )


def looped(shape: Shape, indices: Indices, statement: str) -> str:
    """A statement in loops over all elements; empty where there are none.

    Axes whose elements follow each other in all arrays share a loop.
    """
    if 0 in shape:
        return ""
    loops: list[tuple[str, int]] = []  # the innermost first
    for index, size in reversed(list(zip(indices, shape, strict=True))):
        if index == "0":
            continue
        inner, length = loops[-1] if loops else ("", 0)
        pair = rf"\b{index} \* (\d+) \+ {inner}\b(?: \* (\d+))?(?! \*)"
        strides = re.findall(pair, statement)
        names = [rf"\b{name}\b" for name in (index, inner)]
        uses = [len(re.findall(name, statement)) for name in names]
        is_whole = all(int(far) == length * int(near or 1) for far, near in strides)
        if loops and is_whole and uses == [len(strides)] * 2:
            statement = re.sub(rf"\b{index} \* \d+ \+ {inner}\b", inner, statement)
            loops[-1] = (inner, length * size)
        else:
            loops.append((index, size))
    heads = [f"for (int {name} = 0; {name} < {n}; {name}++)" for name, n in loops]
    return " ".join([*reversed(heads), statement])
