"""OpenCV, or an error with the command that installs it."""

from s2c2a.lab.tracking.poses import TrackingError

try:
    import cv2 as cv2
except ImportError as error:
    raise TrackingError(
        "webcams and tags need OpenCV; install it with "
        '`pip install -c constraints.txt ".[camera]"`'
    ) from error
