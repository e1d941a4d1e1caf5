"""Border to robots and controllers, which may be a user's own: errors name them."""

from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.errors import S2C2AError


@contextmanager
def named_errors(error_type: type[S2C2AError], action: str) -> Iterator[None]:
    """Turn any foreign exception into an error of the package.

    Args:
        error_type: of the error; the exception is its cause.
        action: what failed, such as `Puppet.send failed in step 3`.

    Raises:
        S2C2AError: the block raised an exception; the package's own are not changed.
    """
    try:
        yield
    except S2C2AError:
        raise
    except Exception as error:
        text = f"{type(error).__name__}: {error}"
        raise error_type(f"{action}: {text}") from error
