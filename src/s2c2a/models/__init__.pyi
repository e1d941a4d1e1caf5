from .actions import (
    C2A as C2A,
)
from .actions import (
    C2AOptions as C2AOptions,
)
from .actions import (
    History as History,
)
from .actions import (
    LSTMOptions as LSTMOptions,
)
from .c2s import (
    C2S as C2S,
)
from .c2s import (
    C2SOptions as C2SOptions,
)
from .c2s import (
    ForwardOptions as ForwardOptions,
)
from .chain_training import (
    ChainOptions as ChainOptions,
)
from .local_training import (
    LocalOptions as LocalOptions,
)
