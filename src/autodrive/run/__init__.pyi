from .options import PageOptions as PageOptions
from .options import RunOptions as RunOptions
from .runner import Run as Run
from .runner import RunObserver as RunObserver
from .runner import StopRequest as StopRequest
from .runner import simulate as simulate
from .summary import Summary as Summary
