"""The response of a vibration mode to commands that are held."""

import numpy as np

from s2c2a.lab.tracking.delayed_response import second_order_response

PERIOD = 0.1  # s


def delayed_mode(held, frequency, damping, delay):
    """Tilts at the steps, in which commands are held; the delay is in steps."""
    fine = 1000
    path = np.repeat(held - held[0], fine)
    swung = second_order_response(path, PERIOD / fine, frequency, damping)
    moments = np.arange(len(held)) - delay
    return held[0] + np.interp(moments, np.arange(len(path)) / fine, swung)


def test_a_vibration_from_rest_is_that_of_a_simulation_in_small_steps():
    # held from one step on, felt at 1.25
    held, fine, rate = np.array([0.0, *[1.0] * 20]), 1000, 2 * np.pi * 1.5
    swung, x, v = [0.0], 0.0, 0.0
    for step in range(20 * fine):
        desired = float(step >= 1.25 * fine)
        v += (rate**2 * (desired - x) - 2 * 0.2 * rate * v) * PERIOD / fine
        x += v * PERIOD / fine
        if (step + 1) % fine == 0:
            swung.append(x)
    np.testing.assert_allclose(delayed_mode(held, 1.5, 0.2, 0.25), swung, atol=0.01)
