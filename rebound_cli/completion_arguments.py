"""The arguments of `rebound completion`."""

from rebound_cli.arguments import Commands, runs


def add_completion(commands: Commands) -> None:
    completion = commands.add_parser(
        "completion",
        help="completion for a shell",
        description='Prints a script for a shell to read: eval "$(rebound completion bash)" completes its words.',
    )
    completion.add_argument("shell", choices=("bash", "zsh"))
    completion.set_defaults(run=runs("rebound_cli.completion:run_completion"))
