"""The arguments of `bench campaign`."""

from pathlib import Path

from bench.arguments import add_vehicles, add_workers
from bench.recoveries.arguments import add_recoveries
from rebound_cli.arguments import Commands, count, runs


def add_campaign(commands: Commands) -> None:
    campaign = commands.add_parser(
        "campaign",
        help="fly random missions in random rooms and write what became of them",
        description="Random missions with both airframes, hits with both laws; see bench/notes/results.md.",
    )
    campaign.add_argument("--missions", type=count, default=1000, metavar="N", help="random missions (default 1000)")
    campaign.add_argument(
        "--first-seed", type=count, default=1, metavar="SEED", help="of the first; the others follow (default 1)"
    )
    add_vehicles(campaign, "every mission")
    campaign.add_argument(
        "--hits", type=count, default=5, metavar="SEEDS", help="of each hit with each recovery law (default 5)"
    )
    add_workers(campaign)
    campaign.add_argument(
        "--only", type=count, metavar="SEED", help="fly this one mission again and keep its whole run folder"
    )
    campaign.add_argument(
        "--airframe", choices=("foldable", "rigid"), help="with --only, which of its two flights (default foldable)"
    )
    campaign.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of campaign.md, or of drawn.md, and images (default: build); with --only the run folder "
        "(default: runs/<time>-random-SEED)",
    )
    campaign.set_defaults(run=runs("bench.campaign_report.command:run_campaign_command"))
    parts = campaign.add_subparsers(metavar="PART", dest="part")
    add_recoveries(parts)
    page = parts.add_parser(
        "page",
        help="a campaign's results as one page to look at",
        description="Small multiples, every failure with the command that flies it again, and two versions compared.",
    )
    page.add_argument(
        "record", type=Path, nargs="?", metavar="RECORD", help="of random missions (default: the newest that there is)"
    )
    page.add_argument("--against", type=Path, metavar="RECORD", help="another version's, to be compared with")
    page.add_argument("--out", type=Path, metavar="FILE", help="default: beside the record, as .html")
    page.set_defaults(run=runs("bench.campaign_report.page:run_page"))
