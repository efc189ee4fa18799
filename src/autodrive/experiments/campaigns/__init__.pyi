from .campaign import Campaign as Campaign
from .executor import Executor as Executor
from .executor import LocalExecutor as LocalExecutor
from .runs import CampaignObserver as CampaignObserver
from .runs import Outcome as Outcome
from .runs import run_campaign as run_campaign
from .scene import RunScene as RunScene
