"""The demo itself: explore while learning, then drive on what was learned."""

import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from agents.demo.fleet import Fleet
from agents.demo.watch import Watch
from agents.naming import naming_of
from agents.progress import ERRORS
from agents.status import PerceiverStatus, RobotStatus
from agents.terminal import LearnerView, Terminal
from agents.transport import free_endpoint, open_session, present
from llrp_online.configuration import RobotConfiguration
from llrp_online.status import LearnerStatus

_LOOK_EVERY_S = 0.25
#: Importing PyTorch on a slow disk takes a while.
_START_S = 60.0
_DASHBOARD_PORT = 8080


@dataclass(frozen=True)
class Plan:
    """What a demo does.

    Attributes:
        config: the robot's TOML.
        scenario: the arena's TOML.
        seed: of layout, noise, controller and learner.
        minutes: of exploring.
        drive_minutes: of driving on predictions alone, afterwards.
        speed: of the robot's time; inf: as fast as it goes.
        output: the run's folder.
        dashboard: start one, to watch it in a browser.
    """

    config: Path
    scenario: Path
    seed: int
    minutes: float
    drive_minutes: float
    speed: float
    output: Path
    dashboard: bool = False

    @property
    def recording(self) -> Path:
        """Everything that was said."""
        return self.output / "run.mcap"


@dataclass(frozen=True)
class Outcome:
    """How it went: the last status of each agent, and the robot's at the end of exploring."""

    learner: LearnerStatus | None
    perceiver: PerceiverStatus | None
    explored: RobotStatus | None
    driven: RobotStatus | None


def show(plan: Plan, configuration: RobotConfiguration, stop: threading.Event) -> Outcome:
    """Run it to its end, or until `stop` is set."""
    endpoint = free_endpoint()
    robot = configuration.robot.name
    view = LearnerView(robot, configuration.targets.build().poses)
    with (
        open_session(endpoint, hub=True, name="demo", naming=naming_of(configuration)) as session,
        Fleet(plan.config, endpoint, plan.output / "logs") as fleet,
        Terminal(view, ERRORS) as terminal,
    ):
        watch = Watch(session, robot)
        if plan.dashboard:
            port = _free_port(_DASHBOARD_PORT)
            saved = ("--save-to", str(plan.output / "saved"))
            fleet.start("dashboard", "dashboard", "--port", str(port), *saved, spare=True)
            ERRORS.print(f"watch it in a browser: http://127.0.0.1:{port}/", highlight=False)

        def until(done: Callable[[], bool], limit_s: float | None = None) -> bool:
            waited_s = 0.0
            while not done() and not stop.is_set() and (limit_s is None or waited_s < limit_s):
                terminal.show(watch.glance(fleet.alive()))
                fleet.check(may_end="controller")
                stop.wait(_LOOK_EVERY_S)
                waited_s += _LOOK_EVERY_S
            return done()

        minutes = [str(minute) for minute in range(1, int(plan.minutes) + 1)] or ["1"]
        fleet.start("recorder", "record", "--output", str(plan.recording))
        fleet.start("perceiver", "perceive")
        learn = ("learn", "--output", str(plan.output), "--seed", str(plan.seed))
        fleet.start("learner", *learn, "--at-minutes", *minutes, "--json")
        everyone = {"recorder", "perceiver", "learner"}
        if not until(lambda: everyone <= present(session, robot), _START_S) and not stop.is_set():
            raise RuntimeError(
                f"{everyone - present(session, robot)} did not start within {_START_S:g} s: see {plan.output / 'logs'}"
            )
        drive = ("control", "--seed", str(plan.seed), "--behaviour")
        fleet.start("controller", *drive, "seek", "--minutes", str(plan.minutes))
        world = ("--scenario", str(plan.scenario), "--seed", str(plan.seed))
        fleet.start("robot", "robot", *world, "--speed", str(plan.speed))
        until(lambda: fleet.ended_well("controller"))
        explored = watch.robot
        if plan.drive_minutes and not stop.is_set():
            fleet.stop("controller")
            fleet.start("controller", *drive, "avoid", "--minutes", str(plan.drive_minutes))
            until(lambda: fleet.ended_well("controller"))
        if not stop.is_set():  # who was interrupted wants it over at once, and all end together
            fleet.stop("robot", "controller")
            fleet.stop("learner", "perceiver")
            fleet.stop()
        return Outcome(watch.learner, watch.perceiver, explored, watch.robot)


def _free_port(wanted: int) -> int:
    """This port on loopback if nobody listens there, else another."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", wanted))
        except OSError:
            probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
