"""`rebound detectors`: works the bench's campaigns out and writes tables and pictures."""

from argparse import Namespace

from rebound_cli.campaign.run import Workers, failures_text, run_campaign
from rebound_cli.detectors.campaigns import hits_campaign
from rebound_cli.detectors_report.hits import hits_text


def run_detectors(options: Namespace) -> int:
    """0 when everything is written, whatever it says."""
    workers = Workers(options.jobs, options.scheduler)
    campaign = hits_campaign(options.hits)
    results = run_campaign(campaign, workers)
    print(failures_text(campaign, results))
    print(hits_text(campaign.cases, results.results))
    return 0
