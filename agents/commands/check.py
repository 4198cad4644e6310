"""`llrp check`: look over a recording or a live robot, and say the likely cause and the mend of what is wrong."""

import argparse
import json
import math
from pathlib import Path

from agents.agent import joined
from agents.checks import Checker, Finding, Survey, propose
from agents.commands import options
from agents.offline import shares
from agents.progress import track, track_recordings
from agents.transport import subscribe_all
from agents.usage import UsageError
from replay.recording import Message, read

_LIVE_S = 10.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    parser.add_argument(
        "recordings", type=Path, nargs="*", metavar="RECORDING", help="MCAP files or bags; none: --live"
    )
    parser.add_argument("--live", action="store_true", help="listen to the robot instead")
    parser.add_argument(
        "--seconds", type=options.positive, default=_LIVE_S, help=f"how long to listen (default {_LIVE_S:g})"
    )
    options.add_agent(parser, optional="left out: propose one for the recordings")
    options.add_json(parser)
    parser.epilog = (
        "Exit code 1 if there is an error among the findings.\n\n"
        "examples:\n  llrp check WALK.mcap --config configs/nao.toml\n"
        "  llrp check --live --config configs/thymio.toml\n"
        "  llrp check WALK > rover.toml                                 (a configuration to begin with)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Check and print."""
    if bool(arguments.recordings) == arguments.live:
        raise UsageError("expected either recordings or --live")
    if arguments.config is None:
        if arguments.live:
            raise UsageError("--live needs --config; of a robot you do not know yet, check a recording")
        return _propose(arguments)
    configuration = options.load_configuration(arguments)
    found: dict[str, list[Finding]] = {}
    for path, told in track_recordings(arguments.recordings, "checking"):
        checker = Checker(configuration)
        for message, share in shares(read(path)):
            checker.add(message)
            told(share)
        found[str(path)] = checker.findings()
    if arguments.live:
        checker = Checker(configuration)
        with (
            joined(configuration, "check", alone=False) as agent,
            subscribe_all(
                agent.session,
                agent.robot,
                lambda m: checker.add(Message(m.key, m.type, m.wall_ns(), m.data)),
            ),
        ):
            tenths = range(math.ceil(10 * arguments.seconds))
            for _ in track(tenths, "listening", len(tenths)):
                if agent.stop.wait(0.1):
                    break
        found[configuration.robot.name] = checker.findings()
    if arguments.json:
        print(json.dumps({source: [finding._asdict() for finding in findings] for source, findings in found.items()}))
    else:
        for source, findings in found.items():
            print(f"{source}: {'nothing to say' if not findings else ''}")
            for finding in findings:
                print("  " + str(finding).replace("\n", "\n  "))
    return int(any(finding.severity == "error" for findings in found.values() for finding in findings))


def _propose(arguments: argparse.Namespace) -> int:
    """A configuration on standard output, or what is missing for one."""
    survey = Survey()
    for path, told in track_recordings(arguments.recordings, "reading"):
        for message, share in shares(read(path)):
            survey.add(message)
            told(share)
    proposal = propose(survey, arguments.recordings[0].stem)
    if arguments.json:
        topics = {topic: {"type": what.type, "rate_hz": what.rate_hz} for topic, what in survey.topics.items()}
        print(json.dumps({"toml": proposal.toml, "missing": proposal.missing, "topics": topics}))
    elif proposal.missing:
        there = ", ".join(f"{topic} ({what.type})" for topic, what in sorted(survey.topics.items())) or "nothing"
        raise ValueError(
            f"{', '.join(map(str, arguments.recordings))}: no configuration can be proposed\n  "
            + "\n  ".join([*proposal.missing, f"what there is: {there}"])
        )
    else:
        print(proposal.toml, end="")
    return int(bool(proposal.missing))
