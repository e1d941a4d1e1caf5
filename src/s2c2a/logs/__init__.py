"""Import of recordings of other arms: log files and a map become episodes and an arm.

The pipeline (`pipeline.import_logs`):

1. `reading` chooses the reader of a file (`text_files`, `json_lines`, `array_files`,
   `sheet_files`, `parquet_files`, `motive`, `qualisys`), which gives named columns
   (`tables`).
2. `log_map` validates the map, which describes columns, units, and the frame.
3. `take` converts the columns to SI units, in the frame of the log; `time_join` joins
   files with clocks of their own, which `clocks` estimates.
   `cleaning` excludes poses that cannot be true.
4. `resampling` splits takes into segments without gaps, at the control rate.
5. `registration` estimates the base frame and the module lengths.
6. `cable_search` finds modules, signs, and coupling of the cables; `assignment` ranks
   candidates, and `model_fit` fits the model in `cable_model` to compare them.
7. `arm_file` writes the identified arm with the uncertainty of each number.
8. `rig` converts the segments to episodes; another take reuses it.
   `take_change` distinguishes a moved camera, homed motors and a payload.
9. `summary` describes the result.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
