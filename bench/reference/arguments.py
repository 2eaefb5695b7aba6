"""The arguments of `bench docs` and `bench stamps`."""

from rebound_cli.arguments import Commands, runs


def add_docs(commands: Commands) -> None:
    text = "Models, arguments, state tables and docstrings as the pages of docs/reference."
    docs = commands.add_parser("docs", help="write the generated pages of the manual", description=text)
    docs.add_argument("--check", action="store_true", help="write nothing; exit 1 where a page is not up to date")
    docs.set_defaults(run=runs("bench.reference.command:run_docs"))


def add_stamps(commands: Commands) -> None:
    text = "Lists figures and tables of the manual that are older than the code they speak of, or bear no stamp."
    stamps = commands.add_parser("stamps", help="look for figures and tables that are out of date", description=text)
    stamps.add_argument("--release", action="store_true", help="exit 1 where there is one")
    stamps.set_defaults(run=runs("bench.reference.stamps:run_stamps"))
