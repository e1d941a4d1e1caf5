"""Strategies: estimator, planner and controller put together; the paper's own and its comparisons."""

from s2c2a.models import LSTMOptions
from s2c2a.strategies.lstm import LSTMStrategy, TrainedLSTM, train_lstm_strategy
from s2c2a.strategies.recipe import (
    RECIPES,
    Recipe,
    load_recipe,
    recipe_from,
    recipe_named,
    save_recipe,
)
from s2c2a.strategies.s2c2a import (
    Watched,
    observer_of,
    planning_as,
    s2c2a_batch_planner,
    s2c2a_strategy,
    shipped_networks,
    train_s2c2a,
    training_data,
)
from s2c2a.strategies.strategy import (
    AnyStrategy,
    Strategy,
    fitted_gains,
    pcc_fitted_strategy,
    pcc_strategy,
)
from s2c2a.strategies.trained import (
    TrainedNetworks,
    load_lstm,
    load_strategy,
    save_lstm,
    save_strategy,
)
from s2c2a.strategies.transfer import transferred
