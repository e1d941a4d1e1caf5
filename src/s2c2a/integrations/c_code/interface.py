"""A C source file with its header, from two functions of JAX arrays: start and step."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code import (  # noqa: F401  # they register their rules
    array_rules,
    control_rules,
    linear_algebra_rules,
)
from s2c2a.integrations.c_code.program import (
    Constants,
    Program,
    definition,
    kind_of,
    literal,
)
from s2c2a.integrations.c_code.support import support_for
from s2c2a.integrations.c_code.values import Kind, Shape, Stored
from s2c2a.integrations.c_code.writer import Writer


class Field(NamedTuple):
    """An array of a structure in C.

    Attributes:
        name: of the member.
        kind: of its elements.
        shape: of the array.
    """

    name: str
    kind: Kind
    shape: Shape

    @property
    def declaration(self) -> str:
        """The member in C."""
        return f"{self.kind} {self.name}{brackets(self.shape)}"

    def pointer(self, structure: str) -> str:
        """Pointer to the first element, for one of the structure's pointer."""
        return f"&{structure}->{self.name}{'[0]' * len(self.shape)}"


@dataclass(frozen=True)
class Generated:
    """Text of a C program.

    Attributes:
        header: of its interface.
        source: that implements it.
        constant_bytes: of arrays that never change.
        memory_bytes: of the structure that the caller provides.
    """

    header: str
    source: str
    constant_bytes: int
    memory_bytes: int


def generate(
    name: str,
    about: str,
    start: Callable[[Any], Any],
    step: Callable[[Any, Any], tuple[Any, Any]],
    example: Any,
    first: Callable[[Any], Any],
) -> Generated:
    """Write C99 of a function with memory.

    The header declares `NAME_input`, `NAME_memory`, `NAME_clear`, `NAME_start` and
    `NAME_step`; members of the input are named by the path of their array. The memory's
    last array is a truth value, which start and step return.

    Args:
        name: prefix of all names in C.
        about: lines of the comment at the head of both files.
        start: from the first input to the memory.
        step: from memory and input to the output, one array, and the memory.
        example: an input; its values are those of `NAME_clear`.
        first: the part of the input that `start` reads.

    Raises:
        S2C2AError: an operation has no rule, or the name is none of C.
    """
    if not re.fullmatch(r"[a-zA-Z]\w*", name):
        raise S2C2AError(
            f"'{name}' is no name in C; choose --out with letters, digits and _ only"
        )
    fields = fields_of(example)
    memory = jax.eval_shape(start, first(example))
    command, _ = jax.eval_shape(step, memory, example)
    layout = Layout.of(jax.tree.leaves(memory))
    constants = Constants(name)
    parameters = (
        f"const {name}_input *in, const float *m, const int32_t *n, "
        "float *new_m, int32_t *new_n, float *out"
    )
    begin = Program(f"{name}_run_start", constants, parameters)
    go_on = Program(f"{name}_run_step", constants, parameters)
    given = [
        Stored.contiguous(field.kind, field.shape, f"({field.pointer('in')})")
        for field in fields
    ]
    begun = jax.make_jaxpr(start)(first(example))
    read = given[: len(begun.jaxpr.invars)]
    _write(begin, begun, read, layout.arrays(*NEW_MEMORY))
    stepped = jax.make_jaxpr(step)(memory, example)
    output = Stored.contiguous("float", command.shape, "out")
    targets = [output, *layout.arrays(*NEW_MEMORY)]
    _write(go_on, stepped, [*layout.arrays(*OLD_MEMORY), *given], targets)
    spaces = {
        kind: max(begin.workspaces[kind].size, go_on.workspaces[kind].size, 1)
        for kind in begin.workspaces
    }
    body = "\n\n".join(
        [
            begin.text(),
            go_on.text(),
            _interface(name, fields, example, command.shape, layout.integers - 1),
        ]
    )
    known = constants.used_in(body)
    texts = "\n".join(definition(each, values) for each, values in known.items())
    constant_bytes = sum(values.nbytes for values in known.values())
    includes = f'#include "{name}.h"\n#include <math.h>\n#include <stdlib.h>'
    source = [f"/* {about} */", includes, support_for(body), texts, body]
    words = sum(spaces.values()) + 2 * (layout.floats + layout.integers)
    memory_bytes = 4 * words
    header = _header(name, about, fields, layout, spaces, command.shape)
    return Generated(header, "\n\n".join(source) + "\n", constant_bytes, memory_bytes)


OLD_MEMORY = "m", "n"
NEW_MEMORY = "new_m", "new_n"
"""Names of the pointers to floats and integers of the memory."""


class Layout(NamedTuple):
    """Where the arrays of the memory lie, by type, one behind the other.

    Attributes:
        leaves: shapes and types of the arrays.
        floats: number of floats.
        integers: number of integers.
    """

    leaves: list[Any]
    floats: int
    integers: int

    @classmethod
    def of(cls, leaves: list[Any]) -> "Layout":
        """The layout of arrays."""
        floats = sum(each.size for each in leaves if kind_of(each.dtype) == "float")
        integers = sum(each.size for each in leaves) - floats
        return cls(leaves, max(floats, 1), max(integers, 1))

    def arrays(self, floats: str, integers: str) -> list[Stored]:
        """The arrays behind two pointers."""
        ends: dict[Kind, int] = {"float": 0, "int32_t": 0}
        bases: dict[Kind, str] = {"float": floats, "int32_t": integers}
        arrays = []
        for leaf in self.leaves:
            kind = kind_of(leaf.dtype)
            offset = str(ends[kind])
            arrays.append(Stored.contiguous(kind, leaf.shape, bases[kind], offset))
            ends[kind] += leaf.size
        return arrays


def fields_of(example: Any) -> list[Field]:
    """Members of the input, named by the paths of their arrays."""
    fields = []
    for path, leaf in jax.tree_util.tree_flatten_with_path(example)[0]:
        words = re.findall(r"\w+", jax.tree_util.keystr(path))
        values = np.asarray(leaf)
        fields.append(Field("_".join(words), kind_of(values.dtype), values.shape))
    return fields


def brackets(shape: Shape) -> str:
    """Sizes of an array in C; nothing for a number."""
    return "".join(f"[{size}]" for size in shape)


def _write(
    program: Program, closed: Any, inputs: list[Stored], targets: list[Stored]
) -> None:
    """Write a jaxpr whose outputs go to the targets."""
    writer = Writer(program)
    outputs = writer.write(closed.jaxpr, closed.consts, inputs)
    for target, output in zip(targets, outputs, strict=True):
        program.assign(target, writer.value(output))


def _header(
    name: str,
    about: str,
    fields: list[Field],
    layout: Layout,
    spaces: dict[Kind, int],
    command: Shape,
) -> str:
    members = "\n".join(f"    {field.declaration};" for field in fields)
    guard = f"{name.upper()}_H"
    return f"""/* {about} */
#ifndef {guard}
#define {guard}

#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

/* Arrays are in C order; modules count from the base. NaN: not known. */
typedef struct {{
{members}
}} {name}_input;

/* All memory of one arm; its content is private. */
typedef struct {{
    float m[2][{layout.floats}];
    int32_t n[2][{layout.integers}];
    float w[{spaces["float"]}];
    int32_t k[{spaces["int32_t"]}];
    int32_t now;
}} {name}_memory;

/* Input of an arm at rest, without targets and obstacles. */
void {name}_clear({name}_input *input);

/* Begin with an arm at rest; only the sensors of the input are read. Returns 0 where
   one of them is NaN or infinite: start again, since all steps would hold the arm. */
int {name}_start({name}_memory *memory, const {name}_input *input);

/* One control step: the next command [m or N], within the limits of the arm. Returns 0
   where the last command holds, since a sensor or the goal is NaN or infinite. */
int {name}_step({name}_memory *memory, const {name}_input *input,
    float command{brackets(command)});

#ifdef __cplusplus
}}
#endif

#endif
"""


def _interface(
    name: str, fields: list[Field], example: Any, command: Shape, status: int
) -> str:
    pairs = zip(fields, jax.tree.leaves(example), strict=True)
    defaults = "\n".join(_default(field, np.asarray(leaf)) for field, leaf in pairs)
    return f"""void {name}_clear({name}_input *input)
{{
{defaults}
}}

int {name}_start({name}_memory *memory, const {name}_input *input)
{{
    {name}_run_start(memory->w, memory->k, input, memory->m[0], memory->n[0],
        memory->m[0], memory->n[0], memory->w);
    memory->now = 0;
    return memory->n[0][{status}];
}}

int {name}_step({name}_memory *memory, const {name}_input *input,
    float command{brackets(command)})
{{
    int32_t now = memory->now;
    {name}_run_step(memory->w, memory->k, input, memory->m[now], memory->n[now],
        memory->m[1 - now], memory->n[1 - now], &command{"[0]" * len(command)});
    memory->now = 1 - now;
    return memory->n[1 - now][{status}];
}}"""


def _default(field: Field, values: np.ndarray) -> str:
    """Statements that set a member to its values."""
    first = values.flat[0]
    if (values == first).all() or np.isnan(values).all():
        value = literal(first.item())
        start = f"    {field.kind} *{field.name} = {field.pointer('input')};\n"
        loop = f"    for (int i = 0; i < {values.size}; i++) {field.name}[i] = {value};"
        return start + loop
    lines = []
    for place in np.ndindex(values.shape):
        indices = "".join(f"[{index}]" for index in place)
        lines.append(
            f"    input->{field.name}{indices} = {literal(values[place].item())};"
        )
    return "\n".join(lines)
