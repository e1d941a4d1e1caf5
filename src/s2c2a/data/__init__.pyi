from .babbling import (
    BABBLING as BABBLING,
)
from .babbling import (
    episode_actions as episode_actions,
)
from .collecting import (
    CollectOptions as CollectOptions,
)
from .collecting import (
    collect as collect,
)
from .collecting import (
    describe_excluded as describe_excluded,
)
from .recording import (
    Recording as Recording,
)
from .recording import (
    load_recording as load_recording,
)
from .windows import (
    Samples as Samples,
)
from .windows import (
    Split as Split,
)
from .windows import (
    controller_samples as controller_samples,
)
from .windows import (
    forward_samples as forward_samples,
)
