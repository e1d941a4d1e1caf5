"""The arm in the browser: control of the arm, a scene drawn from State values alone, panels, and a gate before them.

Everything here that knows viser is imported by the verbs `live` and `view` only; the
rest of the package works without it. `control` moves the arm, in a `process` of its
own; `window` and `scene` draw it, `panel` asks, `session` says who drives, `gate` who
may come in, and has the Stop.
"""
