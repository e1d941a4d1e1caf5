"""Live page and viewer: control an arm in the browser, view runs and recordings.

Only the commands `live` and `view` import the modules that need viser; the rest of the
package works without it. `control` runs the arm, in a separate `process`. `window` and
`scene` draw the arm from State values, `panel` takes the driver's input, `browsers`
decides which browser drives, and `gate` controls access and serves the Stop button.
"""
