"""The online learner: events go in, labelled frames are remembered, the network trains, better weights come out.

No thread and no clock in here: time is the sensors'. Driven by `llrp_online.background` it learns while the robot
roams; driven event by event over recordings it is deterministic: the same recordings and seed give the same weights.
"""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llrp_online import checkpoint
from llrp_online.architecture import Weights
from llrp_online.calibration import Calibration
from llrp_online.calibrator import Calibrator
from llrp_online.configuration import RobotConfiguration
from llrp_online.diary import Diary, Entry, Totals
from llrp_online.drift import DriftDetector, DriftEvent
from llrp_online.events import Event, OdometrySample
from llrp_online.held_out import HeldFrame, HeldOut
from llrp_online.labeller import Labeller, NewFrame
from llrp_online.odometer import Odometer
from llrp_online.pace import Pace
from llrp_online.predictor import Predictor
from llrp_online.prequential import Prequential
from llrp_online.publisher import Publisher, Version
from llrp_online.status import LearnerStatus
from llrp_online.trainer import Trainer
from replay.buffer import BufferSettings, ReplayBuffer
from replay.updates import Updates

#: Drift events remembered, newest last.
_EVENTS = 100
#: Frames over which the status tells the prequential score.
_STATUS_FRAMES = 600


class Learner:
    """One robot's learner.

    Args:
        configuration: the robot's.
        trainer: what takes the training steps; another one for studies of other losses.
    """

    def __init__(
        self, configuration: RobotConfiguration, *, trainer: Callable[[RobotConfiguration], Trainer] = Trainer
    ) -> None:
        self.configuration = configuration
        self.paused = False
        self._make_trainer = trainer
        self._build()

    def _build(self) -> None:
        configuration = self.configuration
        targets = configuration.targets.build()
        outputs = configuration.outputs
        memory, publishing = configuration.memory, configuration.publishing
        settings = BufferSettings(
            round(memory.budget_mb * 1e6),
            memory.recent_frames,
            memory.recent_share,
            memory.policy,
            memory.max_uses,
            memory.positives_floor,
            memory.duplicate_distance,
            configuration.training.seed,
        )
        self.labeller = Labeller(configuration)
        self.buffer = ReplayBuffer(configuration.picture_shape, outputs, settings)
        self.held_out = HeldOut(publishing.held_out_share, publishing.held_out_block_s, publishing.held_out_frames)
        self.trainer = self._make_trainer(configuration)
        self.publisher = Publisher(publishing, self.trainer.judge)
        self.predictor = Predictor.of(configuration)
        self.prequential = Prequential(targets.poses, configuration.sensors)
        self.calibrator = Calibrator(configuration.calibration, self.prequential)
        self.pace = Pace(configuration.training.steps_per_second)
        self.odometer = Odometer(configuration.odometry.limits())
        self._drift = DriftDetector(len(self.prequential.band_edges_m))
        self.drift_events: deque[DriftEvent] = deque(maxlen=_EVENTS)
        self.closed_counts = np.zeros((*outputs, 2), np.int64)
        self.alarms = self._frames = self._labelled = 0
        self._loss: float | None = None
        self._loss_sum = 0.0
        self.diary = Diary(configuration.labels.window_s + configuration.odometry.max_delay_s)
        self.drift_lived_s: deque[float] = deque(maxlen=_EVENTS)

    # --- the loop: take events, then take the steps that are due

    def take(self, event: Event) -> Updates:
        """Take in one event: predict each new frame, remember each label that became known; the label updates."""
        self.pace.advance(event.t_ns, learning=self._can_learn())
        if isinstance(event, OdometrySample):
            self.odometer.add(event)
        outcome = self.labeller.take(event)
        for frame in outcome.frames:
            self._predict(frame)
        if outcome.updates:
            self._remember(outcome.updates)
        return outcome.updates

    def due(self) -> bool:
        """Is a training step due, by the sensors' clock?"""
        return not self.paused and self.pace.due()

    def step(self) -> Version | None:
        """One training step, and, when it is time, new weights: the version published, or None."""
        self.pace.taken()
        batch = self.buffer.sample(self.configuration.training.batch)
        if batch is None:
            return None
        self._loss = self.trainer.step(batch, self.buffer.class_counts)
        self._loss_sum += self._loss
        if not self.publisher.due(self._lived_ns):
            return None
        now_ns = self._lived_ns
        calibration = self.calibrator.at(now_ns)
        return self._published(self.publisher.offer(self.trainer.weights(), self.held_out.batch(), now_ns, calibration))

    def end_recording(self) -> None:
        """Nothing that comes next belongs to this trajectory."""
        self._remember(self.labeller.end_trajectory())
        self.pace.end_recording()
        self.odometer.end_recording()

    @property
    def _lived_ns(self) -> int:
        """The clock that publishing goes by: the robot's life, since recordings' clocks may lie in any order."""
        return round(self.pace.lived_s * 1e9)

    def _can_learn(self) -> bool:
        return not self.paused and len(self.buffer) >= self.configuration.training.warmup_frames

    def _predict(self, frame: NewFrame) -> None:
        if self.diary.is_due(self.pace.lived_s):
            self.diary.note(self.pace.lived_s, self._totals(frame.frame_id))
        self._frames += 1
        if self.predictor.version is not None:
            self.prequential.predicted(frame.frame_id, self.predictor.predict(frame.picture).probabilities)

    def _remember(self, updates: Updates) -> None:
        """Keep what became known of frames: in the slice held out, or in the replay buffer."""
        frame_ids = updates.frame_ids.tolist()
        remembered: list[int] = []
        for row, frame_id in enumerate(frame_ids):
            held = self.held_out.get(frame_id)
            picture = updates.pictures.get(frame_id) if held is None else held.picture
            if picture is None:
                remembered.append(row)
                continue
            frame = HeldFrame(frame_id, picture, updates.labels[row], updates.weight[row])
            if held is None:
                self._admit(frame, int(updates.t_ns[row]))
            else:
                self.held_out.put(frame)
        if remembered:
            ids = [frame_ids[row] for row in remembered]
            self.buffer.update_many(ids, updates.labels[remembered], updates.weight[remembered])
        closed = updates.labels[updates.closed]
        self.closed_counts[..., 0] += (closed == 0).sum(0)
        self.closed_counts[..., 1] += (closed == 1).sum(0)
        for row, losses in self.prequential.resolved(updates.frame_ids, updates.labels, updates.closed).items():
            events = self._drift.update(int(updates.t_ns[row]), losses)
            self.drift_events.extend(events)
            self.drift_lived_s.extend([self.pace.lived_s] * len(events))
            self.alarms += len(events)
            if events:
                self.publisher.mark()  # what it knew before the change stays within reach

    def _admit(self, frame: HeldFrame, t_ns: int) -> None:
        self._labelled += 1
        leaving = self.held_out.put(frame) if self.held_out.wants(t_ns) else frame
        if leaving is not None:
            self.buffer.add(leaving.frame_id, leaving.picture, leaving.labels, leaving.weight)

    def _published(self, version: Version | None) -> Version | None:
        if version is not None:
            self.predictor.load(version.weights, version.number)
        return version

    # --- commands

    def publish_now(self) -> Version:
        """Publish the weights as they are, without asking the gate: at the end of a run."""
        now_ns = self._lived_ns
        version = self.publisher.publish(self.trainer.weights(), now_ns, calibration=self.calibrator.at(now_ns))
        self.predictor.load(version.weights, version.number)
        return version

    def roll_back(self, number: int) -> Version:
        """Go back to a version kept (KeyError says which): it is published anew, and training goes on from it."""
        old = self.publisher.find(number)
        self.trainer.become(old.weights)
        version = self.publisher.publish(old.weights, self._lived_ns, calibration=old.calibration)
        self.predictor.load(version.weights, version.number)
        return version

    def reset(self) -> None:
        """Forget everything and begin anew."""
        published = self.publisher.published
        self._build()
        self.publisher.go_on_from(published)

    def status(self) -> LearnerStatus:
        """What it has to say of itself."""
        newest = self.publisher.newest
        known = self.closed_counts.sum(1)
        return LearnerStatus(
            robot_s=self.pace.lived_s,
            driven_m=self.odometer.metres,
            frames=self._frames,
            waiting=self.labeller.store.waiting,
            labelled=self._labelled,
            known=known.sum(-1).tolist(),
            positives=known[:, 1].tolist(),
            remembered=len(self.buffer),
            steps=self.trainer.steps,
            let_go=self.pace.let_go,
            loss=self._loss,
            version=None if newest is None else newest.number,
            version_age_s=None if newest is None else (self._lived_ns - newest.t_ns) * 1e-9,
            rejected=self.publisher.rejected,
            bands=self.prequential.bands(_STATUS_FRAMES),
            drift_events=self.alarms,
            drops=dict(self.labeller.drops),
            paused=self.paused,
            kept=self.publisher.kept,
            sizes={**self.labeller.store.sizes, **self.buffer.sizes},
        )

    # --- for those who ask

    def minutes(self) -> list[Entry]:
        """What each robot minute was like, the one that is not over yet last."""
        return self.diary.score(self.prequential, self.pace.lived_s, self._totals(self.labeller.next_id))

    def labels_of(self, t_ns: int, frame_id: int) -> tuple[int, NDArray[np.int8]] | None:
        """Id and labels (T, S) as now known of the frame taken at `t_ns`; once its window has closed, of `frame_id`."""
        waiting = self.labeller.store.labels_at(t_ns)
        if waiting is not None:
            return waiting[:2]
        labels = self.prequential.labels(frame_id)
        return None if labels is None else (frame_id, labels)

    def _totals(self, next_id: int) -> Totals:
        steps, (negatives, positives) = self.trainer.steps, self.closed_counts.sum((0, 1)).tolist()
        known, published = negatives + positives, self.publisher.published
        return Totals(next_id, known, positives, steps, self._loss_sum, published, self.publisher.rejected)

    # --- to disk and back

    def save(self, path: str | Path) -> None:
        """Write a checkpoint directory: all that learning goes on from."""
        newest = self.publisher.newest
        training, training_values = self.trainer.state()
        held = self.held_out.state()
        tensors: dict[str, dict[str, NDArray[Any]]] = {
            "weights": dict(self.trainer.weights() if newest is None else newest.weights),
            "training": training,
            "memory": self.buffer.state(),
            "pending": self.labeller.state(),
        }
        if held:
            tensors["held_out"] = held
        manifest = {
            "configuration": self.configuration.model_dump(mode="json"),
            "version": 0 if newest is None else newest.number,
            "training": training_values,
            "memory_random": self.buffer.random_state(),
            "pace": self.pace.state(),
            "driven_m": self.odometer.metres,
            "publisher": self.publisher.state(),
            "calibration": self.calibrator.newest.as_json(),
            "next_id": self.labeller.next_id,
        }
        checkpoint.save(path, tensors, manifest, {"frames": self.buffer.shards()})

    def load(self, path: str | Path) -> None:
        """Go on exactly from a checkpoint that `save` wrote; CheckpointError if it is another robot's."""
        tensors, manifest = checkpoint.load(path)
        self._must_fit(path, tensors["weights"], manifest)
        if "pending" not in tensors:
            raise checkpoint.CheckpointError(
                f"{path}: it was not saved by an online learner, so there is nothing to go on from exactly; "
                "use it for a warm start"
            )
        if not Labeller(self.configuration).state().keys() <= tensors["pending"].keys():
            raise checkpoint.CheckpointError(
                f"{path}: its frames that wait for labels were saved by another version of this program; "
                "use it for a warm start"
            )
        self.reset()
        self.trainer.restore(tensors["training"], manifest["training"])
        self._restore_memory(path, tensors["memory"], manifest)
        self.labeller.restore(tensors["pending"])
        self.held_out.restore(tensors.get("held_out", {}))
        self.pace.restore(manifest["pace"])
        self.odometer.metres = float(manifest.get("driven_m", 0.0))
        self.publisher.restore(manifest["publisher"])
        self._begin_with(tensors["weights"], manifest)

    def warm_start(self, path: str | Path, *, memory: bool = True) -> None:
        """Begin with a checkpoint's weights and, unless told otherwise, its memory; all else begins anew."""
        tensors, manifest = checkpoint.load(path)
        self._must_fit(path, tensors["weights"], manifest)
        self.trainer.become(tensors["weights"])
        if memory and "memory" in tensors:
            tensors["memory"]["uses"][:] = 0  # training offline would have used up all frames many times over
            self._restore_memory(path, tensors["memory"], manifest)
        self._begin_with(tensors["weights"], manifest)

    def _must_fit(self, path: str | Path, weights: Weights, manifest: dict[str, Any]) -> None:
        checkpoint.must_fit(path, manifest, self.configuration.model_dump(mode="json"))
        expected = {name: array.shape for name, array in self.trainer.weights().items()}
        found = {name: array.shape for name, array in weights.items()}
        if expected != found:
            raise checkpoint.CheckpointError(
                f"{path}: its network is another than the configuration's (expected {expected}, got {found}); "
                "give the configuration it was trained with: the same cameras, targets, sensors and network preset"
            )

    def _restore_memory(self, path: str | Path, memory: dict[str, NDArray[Any]], manifest: dict[str, Any]) -> None:
        # Older checkpoints have the frames beside the rest, in one piece.
        frames = [memory] if "pictures" in memory else checkpoint.load_parts(path, "frames")
        self.buffer.restore(memory, frames, manifest["memory_random"])
        self.labeller.next_id = int(manifest["next_id"])

    def _begin_with(self, weights: Weights, manifest: dict[str, Any]) -> None:
        if "calibration" in manifest:  # training offline makes no prequential pairs, so it has none
            self.calibrator.newest = Calibration.of_json(manifest["calibration"])
        self.publisher.go_on_from(int(manifest["version"]))
        version = self.publisher.publish(weights, self._lived_ns, calibration=self.calibrator.newest)
        self.predictor.load(version.weights, version.number)
