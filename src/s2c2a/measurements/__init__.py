"""What a measurement must be to count as true: the one place that decides it.

| what cannot be true | as it arrives | in recorded rows |
| --- | --- | --- |
| missing, late, out of range, too fast | `readings` | |
| contradicts the commands | `following` | |
| repeated bit by bit | `repeats`, `readings` | `repeats`, `frozen_ends` |
| contradicts drives and neighbors | | `outliers` |
| all ends jump at once | `frame_jumps` | `frame_jumps` |

Live checks know the commands and no later row; those of recorded rows know both sides of
a row and all others, but no commands' limits. So they differ where both exist. What needs
a model of the arm stays with it (`estimation.outliers`), and what needs the frames of a
tracker with that (`lab.tracking.frozen_bodies`).
"""
