"""Entry point of the command `s2c2a` and of `python -m s2c2a`."""

from s2c2a.cli.interrupts import exit_on_interrupt


def main() -> None:
    """Run the command line; Ctrl-C ends it cleanly, even during imports."""
    exit_on_interrupt()
    from s2c2a.cli.main import main as run_command  # noqa: PLC0415 (slow import)

    run_command()


if __name__ == "__main__":
    main()
