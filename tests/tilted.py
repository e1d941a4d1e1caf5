"""Directions of an end."""

import numpy as np


def axis(tilt_deg, azimuth_deg):
    """Unit vector tilted from the vertical towards an azimuth."""
    tilt, azimuth = np.deg2rad([tilt_deg, azimuth_deg])
    return [
        np.sin(tilt) * np.cos(azimuth),
        np.sin(tilt) * np.sin(azimuth),
        np.cos(tilt),
    ]
