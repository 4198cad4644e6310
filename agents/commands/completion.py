"""`llrp completion`: what a shell must be told to complete `llrp` by the tab key."""

import argparse
from pathlib import Path

from agents.commands import options

SHELLS = ("bash", "zsh", "fish")


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument("shell", choices=SHELLS)
    parser.epilog = (
        "It prints a script; put it where the shell looks, once, and again after an update:\n"
        "  llrp completion bash > ~/.local/share/bash-completion/completions/llrp\n"
        "  llrp completion zsh > ~/.zfunc/_llrp    (a folder of $fpath, before compinit)\n"
        "  llrp completion fish > ~/.config/fish/completions/llrp.fish"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the script."""
    # Not at the top: it would cost every start of the program that needs no completion.
    import shtab

    from agents.cli import whole_parser

    parser = whole_parser()
    _mark_files(parser, shtab.FILE)
    print(shtab.complete(parser, arguments.shell))
    return 0


def _mark_files(parser: argparse.ArgumentParser, files: object) -> None:
    """Arguments that are paths complete to `files`; shtab reads that from an attribute of the action."""
    for action in parser._actions:
        if isinstance(action.choices, dict):  # the commands
            for command in action.choices.values():
                _mark_files(command, files)
        elif action.type in (Path, options.scenario_path):
            setattr(action, "complete", files)  # noqa: B010 - argparse declares no such attribute
