"""Experiments behind the tables and figures; only `s2c2a reproduce` uses them.

- `table_files`, `run_rows`: rows and tables as files.
- `tables`: the paper's tables, the paths table, and the ablation of the `best` recipe.
- `figures`: the paper's figures, in space (`space`) and over time (`time`).
- `circle`: the circle task for all strategies, and closed-loop tests of C2A.
- `lstm`, `tip_lstm`: the data-driven comparison of the paper, the strategy `lstm`.
- `calibration`: the arms compared with the paper's arm, and the search for parameters.
- `randomized_arms`: all strategies on arms with random model mismatch.
- `targets`, `true_reach`: targets within and out of the reach of a simulated arm.
- `sensors`, `payloads`: state estimation with other sensors, and with payloads.
- `real`, `real_models`: forward models compared on recordings of real arms.
- `plans`: plans compared with a long multi-start search.
"""
