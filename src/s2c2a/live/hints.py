"""What the panel says there is to do."""

OBSTACLES = "Drag an obstacle: the arm gives way. It moves in the plane of the screen; turn the view for another."
HINTS = {
    "circle": ": its tip goes round in a circle",
    "tilt": ": a circle again, and the tip points as far from the vertical as the name says",
    "hold": ": the tip stays, and a module's end does what the name says",
    "reach": ": to a point, with so many obstacles on the way",
    "risk": ": to a point beside an obstacle, more or less near",
    "flee": ": an obstacle comes nearer",
    "follow": ": a target wanders about",
}


def hint_for(task: str | None) -> str:
    """What there is to do."""
    if task is None:
        return "You drive. Drag the violet ball: the arm follows."
    kind = next((said for start, said in HINTS.items() if task.startswith(start)), "")
    return f"*{task}*{kind}. The arm goes to its start; Play begins it."
