"""What the paper printed: (task, arm, strategy, metric) -> mean, standard deviation."""

from typing import Any

from s2c2a.arm import ArmSpec, load_arm

TILTS = {
    "tilt-40": ((2.9, 0.8, 2.1, 1.3), (3.3, 1.0, 2.1, 1.4)),
    "tilt-50": ((2.3, 0.7, 2.8, 1.4), (3.9, 1.4, 4.5, 2.2)),
    "tilt-60": ((2.2, 1.1, 3.5, 2.9), (4.5, 1.0, 7.5, 3.7)),
    "tilt-0": ((2.6, 1.0, 3.3, 1.0), (2.9, 0.8, 4.7, 2.2)),
    "tilt-50-a20": ((3.1, 1.6, 2.4, 1.5, 3.6, 2.7), (4.8, 1.4, 3.9, 2.3, 6.8, 3.4)),
    "tilt-50-c20": ((3.1, 1.2, 3.0, 2.3, 3.5, 3.1), (3.8, 1.1, 5.9, 2.0, 4.4, 2.2)),
}
"""Table III: task -> ours, PCC; each position [cm], tilt [deg] and where printed azimuth [deg], mean and deviation."""


def _table_3() -> dict[tuple[str, ...], tuple[float, float]]:
    found: dict[tuple[str, ...], tuple[float, float]] = {}
    for task, columns in TILTS.items():
        for strategy, numbers in zip(("s2c2a", "pcc"), columns, strict=True):
            pairs = zip(numbers[::2], numbers[1::2], strict=True)
            for metric, pair in zip(("position", "tilt", "azimuth"), pairs, strict=False):
                found[task, "twin_arm", strategy, metric] = pair
    return found


COUPLED = {"simulated_arm_sensing_coupled": (1.7, 0.3), "simulated_arm_actuation_coupled": (1.6, 0.5)}
"""`circle` under sensing and actuation coupling [cm]."""

PRINTED: dict[tuple[str, ...], tuple[float, float]] = {
    ("circle", "twin_arm", "s2c2a", "position"): (2.2, 1.1),  # table III, p-ours
    ("circle", "twin_arm", "pcc", "position"): (2.5, 0.8),  # table III, p-PCC
    ("circle", "simulated_arm", "s2c2a", "position"): (1.5, 0.3),  # table on the simulation
    ("circle", "simulated_arm", "s2c2a-motor", "position"): (1.9, 0.7),  # the same
    ("circle", "simulated_arm", "lstm", "position"): (3.3, 1.7),  # the same
    **_table_3(),
    ("hold-base", "twin_arm", "s2c2a", "constraint"): (0.2, 0.1),  # table V
    ("hold-base", "twin_arm", "s2c2a", "position"): (3.6, 1.7),
    ("hold-middle", "twin_arm", "s2c2a", "constraint"): (1.0, 0.3),
    ("hold-middle", "twin_arm", "s2c2a", "orientation"): (3.2, 1.9),
    ("hold-end", "twin_arm", "s2c2a", "constraint"): (3.9, 0.9),
    ("hold-end", "twin_arm", "s2c2a", "orientation"): (4.3, 2.5),
    ("training", "twin_arm", "C2S", "held-out error"): (1.93, 1.87),  # table II
    ("training", "twin_arm", "C2A", "held-out error"): (0.91, 1.90),  # table II
}
"""Chen et al. 2025. Its simulation compares with other things than PCC, so those rows have no number beside them."""


def printed(task: str, arm: ArmSpec, strategy: str, metric: str) -> dict[str, Any]:
    """`paper_mean` and `paper_std` of a row, nothing where the paper prints nothing or the arm is not the preset."""
    if arm.name in COUPLED and (task, strategy, metric) == ("circle", "s2c2a", "position"):
        return dict(zip(("paper_mean", "paper_std"), COUPLED[arm.name], strict=True))
    pair = PRINTED.get((task, arm.name, strategy, metric))
    if pair is None or not arm.same_body(load_arm(arm.name)):
        return {}
    return {"paper_mean": pair[0], "paper_std": pair[1]}
