"""Networks that come with the package."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError, listed
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.strategies.files import load_networks, stated_errors
from s2c2a.strategies.recipe import recipe_named
from s2c2a.strategies.s2c2a import WEIGHTS
from s2c2a.strategies.session import session_of, with_session
from s2c2a.strategies.trained import TrainedNetworks


@contextmanager
def shipped_file(arm: ArmSpec) -> Iterator[Path]:
    """Yield the file of the networks that come with the package for an arm.

    Raises:
        StrategyError: there are none for this arm.
    """
    others: dict[str, list[str]] = {}
    for file in sorted(WEIGHTS.iterdir(), key=lambda file: file.name):
        if not file.name.endswith(".safetensors"):
            continue
        with resources.as_file(file) as path:
            trained_for, _ = stated_errors(path)
            others[trained_for.name] = trained_for.differences(arm)
            if not others[trained_for.name]:
                yield path
                return
    nearest = min(others, key=lambda name: len(others[name]))
    raise StrategyError(
        f"no trained networks come with the package for '{arm.name}', which differs from "
        f"'{nearest}' in {listed(others[nearest])}; collect data with "
        "`s2c2a collect`, train with `s2c2a train`, and give the file with --weights"
    )


def shipped_networks(arm: ArmSpec) -> TrainedNetworks:
    """The networks that come with the package for an arm.

    Raises:
        StrategyError: there are none for this arm.
    """
    with shipped_file(arm) as path:
        networks = load_networks(path)
    recipe = recipe_named(networks.recipe.name)
    return replace(networks, arm=arm, recipe=recipe)


def networks_from(
    file: str | os.PathLike, arm: ArmSpec | None = None, session: str = ""
) -> TrainedNetworks:
    """Networks of a weight file on the day of its session, or those of the package.

    Args:
        file: of weights; "shipped" for the networks of the package.
        arm: that is driven; that of the file by default.
        session: see `session_of`; by default that beside the weights.

    Raises:
        StrategyError: see `load_networks` and `shipped_networks`.
    """
    if str(file) != SHIPPED:
        return with_session(load_networks(file, arm), session_of(file, session))
    if arm is None:
        raise StrategyError(
            "networks of several arms come with the package, and no arm was given; give "
            "one, such as load_strategy('shipped', load_arm('twin_arm'))"
        )
    return shipped_networks(arm)
