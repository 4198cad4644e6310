"""Driving on predictions alone, beside random turning and the proximity reflex: collisions in unseen layouts.

    python bench/driving.py --checkpoint RUN/checkpoint --scenario tiles

Virtual time, one process: the robot, its picture, the predictor and the controller that `llrp control` runs. A
collision is counted once a contact, however long it lasts.
"""

import argparse
import json
from pathlib import Path

from agents.behaviours import controller
from agents.commands import options
from agents.progress import track
from agents.robots.simulated import load_scenario
from agents.rollout import rollout
from agents.simulated_drive import simulated_robot
from llrp_online import checkpoint
from llrp_online.configuration import RobotConfiguration, load
from llrp_online.predictor import Predictor


def drive(
    configuration: RobotConfiguration, behaviour: str, scenario: Path, seed: int, minutes: float, predictor: Predictor
) -> dict[str, float]:
    """Collisions and metres of one drive."""
    seeing = behaviour == "avoid"
    robot = simulated_robot(configuration, load_scenario(scenario), seed, camera=seeing)
    rate_hz = configuration.simulation.rate_hz if configuration.simulation else 0.0
    path = rollout(
        robot,
        controller(behaviour, configuration, seed),
        configuration,
        60 * minutes,
        predictor if seeing else None,
    )
    metres, last = 0.0, None
    for seen in track(path, f"{behaviour} {seed}", round(60 * minutes * rate_hz)):
        step = seen.true_pose[:2] - (seen.true_pose[:2] if last is None else last)
        metres, last = metres + float((step**2).sum() ** 0.5), seen.true_pose[:2]
    return {"collisions": robot.collisions, "metres": round(metres, 1)}


def main() -> None:
    """Print one line a drive, and all of it as JSON with --json."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, default=Path("configs/thymio.toml"))
    parser.add_argument("--checkpoint", type=Path, required=True)
    parser.add_argument("--scenario", type=options.scenario_path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[201, 202, 203])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    configuration = load(arguments.config)
    outputs = (len(configuration.targets.build()), len(configuration.sensors))
    predictor = Predictor(configuration.network.preset, configuration.picture_shape, outputs)
    predictor.load(checkpoint.load(arguments.checkpoint)[0]["weights"], version=1)
    results = {
        behaviour: [
            drive(configuration, behaviour, arguments.scenario, seed, arguments.minutes, predictor)
            for seed in arguments.seeds
        ]
        for behaviour in ("avoid", "reflex", "blind")
    }
    if arguments.json:
        print(json.dumps({"scenario": arguments.scenario.stem, "seeds": arguments.seeds, "drives": results}))
        return
    for behaviour, drives in results.items():
        for seed, drive_ in zip(arguments.seeds, drives, strict=True):
            print(f"{behaviour:7s} layout {seed}: {drive_['collisions']:4.0f} collisions, {drive_['metres']:6.1f} m")


if __name__ == "__main__":
    main()
