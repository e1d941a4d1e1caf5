"""The arm in the browser: a control loop, a scene drawn from State values alone, panels, and a gate in front of them.

Everything here that knows viser is imported by the verbs `live` and `view` only; the rest of the package works
without it. `loop` moves the arm, `scene` draws it, `panel` asks, `session` says who drives, `gate` who may
come in.
"""
