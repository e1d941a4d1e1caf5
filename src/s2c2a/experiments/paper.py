"""What the paper printed: (task, arm, controller, metric) -> mean, standard deviation."""

from typing import Any

from s2c2a.arm import ArmSpec, load_arm

PRINTED: dict[tuple[str, ...], tuple[float, float]] = {
    ("circle", "twin_arm", "s2c2a", "position"): (2.2, 1.1),  # table III, p-ours
    ("circle", "twin_arm", "pcc", "position"): (2.5, 0.8),  # table III, p-PCC
    ("circle", "simulated_arm", "s2c2a", "position"): (1.5, 0.3),  # table on the simulation
    ("training", "twin_arm", "C2S", "held-out error"): (1.93, 1.87),  # table II
    ("training", "twin_arm", "C2A", "held-out error"): (0.91, 1.90),  # table II
}
"""Chen et al. 2025. Its simulation compares with other things than PCC, so those rows have no number beside them."""


def printed(task: str, arm: ArmSpec, controller: str, metric: str) -> dict[str, Any]:
    """`paper_mean` and `paper_std` of a row, nothing where the paper prints nothing or the arm is not the preset."""
    pair = PRINTED.get((task, arm.name, controller, metric))
    if pair is None or not arm.same_body(load_arm(arm.name)):
        return {}
    return {"paper_mean": pair[0], "paper_std": pair[1]}
