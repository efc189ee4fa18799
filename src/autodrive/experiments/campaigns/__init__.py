"""Campaigns: a scenario, parameters and seeds that are run many times.

The unit of work is a pure function: (scenario, parameters, seed, driver) -> one row of results. `autodrive campaign
FILE.yaml` runs a campaign; `docs/campaigns.md` describes the file. From Python:

    from autodrive.experiments.campaigns import Campaign, run_campaign

    outcome = run_campaign(Campaign.load("campaign.yaml"), workers=2)
    print(outcome.summary["pass"])

Names are imported when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
