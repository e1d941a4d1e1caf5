"""Classes of the user's own that weight files use, as commands are given them."""

from collections.abc import Iterable

from s2c2a.control.options import CONTROLLERS
from s2c2a.errors import StrategyError
from s2c2a.models.registry import MODELS
from s2c2a.strategies.recipe import Recipe


def import_own_classes(model: str | None, controller: str | None) -> None:
    """Import the classes, so that a weight file may name them.

    Raises:
        S2C2AError: there is no such class.
    """
    if model:
        MODELS.named(model)
    if controller:
        CONTROLLERS.named(controller)


def check_own_classes_used(
    recipes: Iterable[Recipe], model: str | None, controller: str | None
) -> None:
    """Refuse classes that no weight file uses: they would have no effect.

    Args:
        recipes: of the weight files.
        model: of a forward model, if one is given.
        controller: of a learned controller, if one is given.

    Raises:
        StrategyError: a class is not used.
    """
    recipes = list(recipes)
    if model:
        _check_used("model", model, MODELS.named(model), [r.c2s for r in recipes])
    if controller:
        used = [recipe.c2a for recipe in recipes]
        _check_used("controller", controller, CONTROLLERS.named(controller), used)


def _check_used(option: str, name: str, kind: type, used: list) -> None:
    if any(type(options) is kind for options in used):
        return
    names = ", ".join(dict.fromkeys(options.model for options in used))
    reason = f"they use {names}" if used else "and none is given"
    raise StrategyError(
        f"--{option} {name} would have no effect: it names the class of a weight file, "
        f"{reason}; leave it out, or give a file that uses it. A recipe file names the "
        "class for training"
    )
