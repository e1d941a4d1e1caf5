"""Other software: environments, exports, streams, and bridges to robot middleware.

Everything here is optional. The packages that a part needs are an extra of the
distribution, and are imported where they are used.
"""
