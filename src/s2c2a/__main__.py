"""Entry point of the command `s2c2a` and of `python -m s2c2a`."""

import os

from s2c2a.cli.interrupts import exit_on_interrupt


def main() -> None:
    """Run the command line; Ctrl-C ends it cleanly, even during imports."""
    exit_on_interrupt()
    limit_blas_to_one_thread()
    from s2c2a.cli.main import main as run_command  # noqa: PLC0415 (slow import)

    run_command()


def limit_blas_to_one_thread() -> None:
    """Limit OpenBLAS of NumPy and SciPy to one thread, unless the user sets a number.

    The matrices of an arm are small. Threads gain nothing, and while other processes
    use the cores, they wait for each other: a fit then takes 30 times as long.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is imported


if __name__ == "__main__":
    main()
