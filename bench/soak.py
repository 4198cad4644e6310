"""Half an hour of roaming as fast as it goes: does memory stay flat, do queues stay short, does everything end?

    python bench/soak.py --minutes 30

All agents as processes over Zenoh, exploring. Once a second the resident memory of each is read, and the learner's own
word on its queue and rings. The replay buffer is given so small a budget that it is full before the warm-up ends: it
grows by intent until then. What may still grow: the window of the prequential score, preallocated for 20,000 frames,
touches its pages one after the other (0.4 MB a robot minute, for the first 33), and the recording's index of chunks.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

from agents.commands import options
from agents.demo.fleet import Fleet
from agents.demo.watch import Watch
from agents.transport import free_endpoint, open_session, present
from llrp_online import background
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.status import LearnerStatus
from replay.clock import LEAD_NS

#: 1,200 frames of 16 kB: full after a few robot minutes.
SMALL_MEMORY = "\n[memory]\nbudget_mb = 20.0\n"
#: Growth after the warm-up beyond this is a leak [MB per robot minute]. Above what the module's docstring allows for.
TOLERANCE_MB = 1.0
WARM_UP = 0.3
END_S = 2.0
START_S = 120.0
#: A robot from which nothing is heard for so long will not come back.
SILENT_S = 30.0


@dataclass
class Samples:
    """Robot minutes, and with them resident memory of each agent [MB] and each of the learner's figures."""

    minutes: list[float] = field(default_factory=list[float])
    memory_mb: dict[str, list[float]] = field(default_factory=dict[str, list[float]])
    learner: dict[str, list[int]] = field(default_factory=dict[str, list[int]])

    def take(self, minutes: float, pids: dict[str, int], status: LearnerStatus) -> None:
        """One more row."""
        self.minutes.append(minutes)
        for name, pid in pids.items():
            self.memory_mb.setdefault(name, []).append(psutil.Process(pid).memory_info().rss / 1e6)
        for name, value in {"backlog": status.backlog, **status.sizes}.items():
            self.learner.setdefault(name, []).append(value)


@dataclass(frozen=True)
class Growth:
    """Of one agent, after the warm-up."""

    warm_mb: float
    end_mb: float
    mb_per_minute: float

    @staticmethod
    def of(minutes: list[float], memory_mb: list[float], warm_up: float) -> "Growth":
        """The slope is that of the line which fits best."""
        at, mb = np.array(minutes), np.array(memory_mb)
        after = at >= warm_up * at[-1]
        slope = float(np.polyfit(at[after], mb[after], 1)[0]) if after.sum() > 1 else math.nan
        return Growth(float(mb[after][0]), float(mb[-1]), slope)


def bounds(configuration: RobotConfiguration) -> dict[str, int]:
    """The most rows that each of the learner's rings and queues may have."""
    simulation, rule, odometry = configuration.simulation, configuration.labels, configuration.odometry
    assert simulation is not None
    rate_hz = simulation.rate_hz
    # A frame waits for its window, and for what may still arrive; readings and odometry are kept twice as long.
    # Odometry keeps the time, and the other sensors may be ahead of it by the clock's lead.
    late_s = odometry.max_delay_s + odometry.max_gap_s + LEAD_NS * 1e-9
    open_s = rule.window_s + late_s
    kept = math.ceil((2 * rule.window_s + late_s) * rate_hz) + 2
    height, width, channels = configuration.picture_shape
    frames = math.ceil(open_s * rate_hz / simulation.camera_divider) + 2
    memory = configuration.memory
    return {
        "backlog": background.QUEUE,
        "frames": frames,
        "readings": kept,
        "odometry": kept,
        "picture_bytes": frames * height * width * channels,
        "recent": memory.recent_frames,
        "memory": round(memory.budget_mb * 1e6) // (height * width * channels),
    }


def roam(arguments: argparse.Namespace, config: Path, folder: Path) -> tuple[Samples, dict[str, float], list[str]]:
    """What was seen, how long each agent took to end [s], and what is left that should not be."""
    configuration, samples = load(config), Samples()
    robot, endpoint = configuration.robot.name, free_endpoint()
    shared = {path.name for path in Path("/dev/shm").glob("*")}
    with open_session(endpoint, hub=True, name="soak") as session, Fleet(config, endpoint, folder / "logs") as fleet:
        watch = Watch(session, robot)
        seed = ("--seed", str(arguments.seed))
        fleet.start("recorder", "record", "--output", str(folder / "run.mcap"))
        fleet.start("perceiver", "perceive")
        fleet.start("learner", "learn", "--output", str(folder / "run"), "--json", *seed)
        fleet.start("controller", "control", *seed)
        deadline_s = time.monotonic() + START_S
        while not set(fleet.pids()) <= present(session, robot):
            fleet.check()
            if time.monotonic() > deadline_s:
                raise RuntimeError(f"not all agents have started within {START_S:g} s: see {folder / 'logs'}")
            time.sleep(0.2)
        fleet.start("robot", "robot", "--scenario", str(arguments.scenario), *seed, "--speed", "max")
        heard_s, minutes = time.monotonic(), 0.0
        while minutes < arguments.minutes:
            time.sleep(1.0)
            fleet.check()
            now = watch.robot.robot_s / 60 if watch.robot is not None else 0.0
            heard_s = heard_s if now == minutes else time.monotonic()
            if time.monotonic() - heard_s > SILENT_S:
                raise RuntimeError(f"the robot has said nothing for {SILENT_S:g} s: see {folder / 'logs'}")
            minutes = now
            if watch.learner is not None and minutes:
                samples.take(minutes, fleet.pids(), watch.learner)
                if not arguments.json:
                    print(f"\r{minutes:5.1f} robot minutes", end="", file=sys.stderr, flush=True)
        pids = fleet.pids()
        ended_s: dict[str, float] = {}
        for name in pids:
            told_s = time.monotonic()
            fleet.stop(name)
            ended_s[name] = time.monotonic() - told_s
    left = [f"process {name} ({pid})" for name, pid in pids.items() if psutil.pid_exists(pid)]
    left += [f"/dev/shm/{path.name}" for path in Path("/dev/shm").glob("*") if path.name not in shared]
    return samples, ended_s, left


def main() -> int:
    """Print the table; 1 where memory grows, a queue is over its bound, or something does not end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=Path("configs/thymio.toml"))
    parser.add_argument("--scenario", type=options.scenario_path, default=options.scenario_path("tiles"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=30.0, help="of the robot's time")
    parser.add_argument("--tolerance", type=float, default=TOLERANCE_MB, help="MB per robot minute")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = folder / "small.toml"
        config.write_text(arguments.config.read_text() + SMALL_MEMORY)
        samples, ended_s, left = roam(arguments, config, folder)
        most = bounds(load(config))
    growth = {name: Growth.of(samples.minutes, mb, WARM_UP) for name, mb in samples.memory_mb.items()}
    peaks = {name: max(values) for name, values in samples.learner.items()}
    faults = [
        f"{n} grows by {g.mb_per_minute:.2f} MB a robot minute"
        for n, g in growth.items()
        if not g.mb_per_minute <= arguments.tolerance
    ]
    faults += [f"{name}: {peak} is over its bound of {most[name]}" for name, peak in peaks.items() if peak > most[name]]
    faults += [f"{name} took {s:.1f} s to end" for name, s in ended_s.items() if s > END_S]
    faults += [f"left behind: {what}" for what in left]
    if arguments.json:
        print(
            json.dumps(
                {
                    "robot_minutes": samples.minutes[-1],
                    "wall_minutes": (time.monotonic() - began_s) / 60,
                    "memory": {name: vars(g) for name, g in growth.items()},
                    "peaks": peaks,
                    "bounds": most,
                    "ended_s": ended_s,
                    "faults": faults,
                    "samples": vars(samples),
                }
            )
        )
    else:
        show(samples, growth, peaks, most, ended_s, (time.monotonic() - began_s) / 60)
        print("\n".join(faults) if faults else "nothing grows, nothing is left")
    return int(bool(faults))


def show(
    samples: Samples,
    growth: dict[str, Growth],
    peaks: dict[str, int],
    most: dict[str, int],
    ended_s: dict[str, float],
    wall_minutes: float,
) -> None:
    """The tables."""
    print(f"\r{samples.minutes[-1]:.1f} robot minutes in {wall_minutes:.1f} minutes; warm-up {WARM_UP:.0%}")
    print(f"{'agent':12s} {'warm':>9s} {'end':>9s} {'growth':>16s} {'ended in':>9s}")
    for name, g in growth.items():
        print(
            f"{name:12s} {g.warm_mb:6.1f} MB {g.end_mb:6.1f} MB {g.mb_per_minute:+9.3f} MB/min {ended_s[name]:7.2f} s"
        )
    print(f"{'of the learner':16s} {'most':>10s} {'bound':>10s}")
    for name, peak in peaks.items():
        print(f"{name:16s} {peak:10d} {most[name]:10d}")


if __name__ == "__main__":
    sys.exit(main())
