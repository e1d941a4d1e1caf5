"""The command `s2c2a`, and `python -m s2c2a`: Control-C is heeded from its first moment on."""

from s2c2a.cli.interrupts import end_at_interrupts


def main() -> None:
    """Entry point."""
    end_at_interrupts()
    from s2c2a.cli.main import main as verbs

    verbs()


if __name__ == "__main__":
    main()
