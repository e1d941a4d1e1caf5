"""Files of the LSTM comparison; see `checkpoint` for the form."""

import os
from dataclasses import asdict

import jax
import numpy as np

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.errors import StrategyError
from s2c2a.networks.lstm import TipLSTM
from s2c2a.strategies.checkpoint import SCHEMA, Metadata, filled, learned, read, write
from s2c2a.strategies.lstm import LSTMOptions, TrainedLSTM

KIND = "s2c2a-lstm"


def save_lstm(trained: TrainedLSTM, path: str | os.PathLike) -> None:
    """Write a trained LSTM; the file appears whole or not at all.

    Raises:
        StrategyError: the file cannot be written.
    """
    metadata = Metadata(
        schema_version=SCHEMA,
        version=s2c2a.__version__,
        arm=arm_to_toml(trained.arm),
        recipe=asdict(trained.options),
        seed=trained.seed,
        percent={"LSTM": trained.percent},
    )
    write(path, KIND, learned(trained.network) | {"curve": np.asarray(trained.curve)}, metadata)


def load_lstm(path: str | os.PathLike, arm: ArmSpec | None = None) -> TrainedLSTM:
    """Read a trained LSTM, for an arm if one is given.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema, or trained for another arm.
    """
    arrays, metadata = read(path, KIND)
    trained_for, options = metadata.trained_for(path, arm), metadata.recipe_as(LSTMOptions, path)
    if "curve" not in arrays or "LSTM" not in metadata.percent:
        raise StrategyError(f"{path} lacks what is known of its training; it is damaged: train it anew")
    blank = TipLSTM.untrained(trained_for, **asdict(options.size), key=jax.random.key(0))
    network = filled(blank, arrays, path)
    return TrainedLSTM(trained_for, options, metadata.seed, network, metadata.percent["LSTM"], arrays["curve"])
