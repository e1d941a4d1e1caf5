"""Strategies: state estimator, planner and controller, composed and chosen by name."""

from s2c2a.strategies.files import check_new_networks, load_networks, save_networks
from s2c2a.strategies.options import NetworkProgress, RunOptions, StrategyOptions
from s2c2a.strategies.pcc import fitted_gains, pcc_strategy
from s2c2a.strategies.prior import pretrain_s2c2a
from s2c2a.strategies.recipe import (
    RECIPES,
    Recipe,
    load_recipe,
    recipe_from,
    recipe_named,
    save_recipe,
)
from s2c2a.strategies.registry import (
    STRATEGIES,
    labeled,
    shown_name,
    strategy_named,
    strategy_of,
    train_networks,
)
from s2c2a.strategies.s2c2a import (
    S2C2A,
    estimator_of,
    planning_as,
    s2c2a_strategy,
    train_s2c2a,
    training_data,
)
from s2c2a.strategies.session import (
    Session,
    describe_use,
    load_session,
    measured_session,
    save_session,
    session_of,
    session_path,
    with_session,
)
from s2c2a.strategies.shipped import networks_from, shipped_networks
from s2c2a.strategies.strategy import Strategy
from s2c2a.strategies.trained import TrainedNetworks
