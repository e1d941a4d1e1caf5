"""Operator at a terminal, whom a held arm asks whether it may resume."""

import sys
from dataclasses import dataclass


@dataclass
class Operator:
    """Somebody who may answer, or nobody; safe from any thread.

    Attributes:
        attends: whether a terminal passes on answers.
        agrees: whether the arm may resume, since the last question.
    """

    attends: bool = False
    agrees: bool = False

    def ask(self, text: str) -> None:
        """Show what happened; an earlier answer does not count.

        Args:
            text: a sentence.
        """
        self.agrees = False
        if self.attends:
            sys.stderr.write(
                f"{text}, and the arm is held. Make sure that nobody touches it, then "
                "press r to resume; without an answer it goes to rest.\n"
            )


OPERATOR = Operator()
"""Operator of this process."""
