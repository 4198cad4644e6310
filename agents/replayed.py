"""The online learner over recordings, in virtual time: event by event, each step when the sensors' clock says so."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from agents.intake import Intake
from agents.offline import messages_of, report_drops
from agents.progress import bar
from llrp_online.learner import Learner


def learn_over(learner: Learner, recordings: Sequence[Path], on_minute: Callable[[int], None] = lambda _: None) -> None:
    """Let `learner` live through recordings, in order; deterministic.

    Args:
        learner: is changed.
        recordings: one trajectory each.
        on_minute: called with the minutes lived each time another whole one is over.
    """
    drops: Counter[str] = Counter()
    with bar() as progress:
        task = progress.add_task("learning", total=len(recordings))
        for done, path in enumerate(recordings):
            intake = Intake(learner.configuration)
            for message, share in messages_of(path, intake):
                minute = learner.minutes
                for event in intake.events(message.topic, message.type, message.data, message.log_ns):
                    learner.take(event)
                    while learner.due():
                        learner.step()
                if learner.minutes > minute:
                    on_minute(learner.minutes)
                progress.update(task, completed=done + share)
            learner.end_recording()
            drops.update(intake.drops)
    report_drops("all recordings", drops + learner.labeller.drops)
