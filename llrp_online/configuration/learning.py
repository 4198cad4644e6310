"""How a robot learns: memory, network, augmentation, training, publishing. Every table may be left out."""

from typing import Literal

from pydantic import Field

from llrp_online.configuration.rig import Table


class Memory(Table):
    """[memory]: the trajectory store and the replay buffer."""

    store_mb: float = Field(default=256.0, gt=0, description="hard budget of frames waiting for labels [MB]")
    budget_mb: float = Field(default=512.0, gt=0, description="hard budget of the replay buffer [MB]")
    recent_frames: int = Field(default=600, ge=8, description="newest frames, always kept")
    recent_share: float = Field(default=0.5, ge=0, le=1, description="share of a batch drawn from the newest frames")
    policy: Literal["balanced", "reservoir", "fifo"] = Field(
        default="balanced", description="who stays when it is full"
    )
    max_uses: int = Field(default=400, ge=1, description="how often one frame may be trained on")
    positives_floor: float = Field(default=0.2, ge=0, le=1, description="share of frames with a positive label to keep")
    duplicate_distance: float = Field(
        default=2.0,
        ge=0,
        description="mean grey difference of two thumbnails below which frames repeat each other; 0: off",
    )


class Network(Table):
    """[network]."""

    preset: Literal["online", "paper"] = Field(default="online", description="`paper` is Nava et al. 2019, figure 5")
    mirrored: bool = Field(
        default=True,
        description="predict from each picture and from its mirror image, and give the mean; not where flip = 0",
    )


class Augmentation(Table):
    """[augmentation]: the paper's four, section IV-D, and colours that are turned."""

    flip: float = Field(default=0.5, ge=0, le=1, description="probability of a mirrored picture, sensors and targets")
    noise: float = Field(default=1 / 3, ge=0, le=1, description="probability of Gaussian noise")
    noise_deviation: float = Field(default=0.02, ge=0, le=1, description="its deviation, of full scale")
    grey: float = Field(default=1 / 3, ge=0, le=1, description="probability of a grey picture")
    shadow: float = Field(default=1.0, ge=0, le=1, description="probability of a soft shadow gradient")
    shadow_strength: float = Field(
        default=0.3, ge=0, le=1, description="largest change across the picture, of full scale"
    )
    colour: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="probability of other colours, red, green and blue turned: for floors that it will never have seen",
    )


class Training(Table):
    """[training]."""

    batch: int = Field(default=64, ge=1, le=4096)
    learning_rate: float = Field(default=1e-3, gt=0, lt=1)
    loss: Literal["cross_entropy", "paper"] = Field(
        default="cross_entropy", description="`paper`: squared error averaged over all entries, unknown ones as zero"
    )
    positive_weight_max: float = Field(
        default=4.0, ge=1, description="clip of the weight that balances positives; 1: off"
    )
    steps_per_second: float = Field(default=5.0, gt=0, description="budget, by the sensors' clock")
    core_share: float = Field(default=1.0, gt=0, le=1, description="largest share of one core, by the wall clock")
    warmup_frames: int = Field(default=32, ge=1, description="labelled frames before the first step")
    average: float = Field(default=0.99, ge=0, lt=1, description="decay of the averaged weights, a step")
    seed: int = Field(default=0, ge=0)


class Calibrating(Table):
    """[calibration]: that a probability that goes out means what it says."""

    every_s: float = Field(default=10.0, gt=0, description="fit anew this often, by the sensors' clock [s]")
    frames: int = Field(default=1200, ge=8, description="newest predicted frames that a fit is of")


class Compute(Table):
    """[compute]."""

    compiled: bool = Field(
        default=True, description="hot paths as compiled code; false: the plain reference, several times slower"
    )


class Publishing(Table):
    """[publishing]: when a new version of the weights goes out."""

    every_s: float = Field(default=2.0, gt=0, description="try this often, by the sensors' clock [s]")
    held_out_share: float = Field(
        default=0.1, ge=0, le=0.5, description="share of frames kept back to judge new weights, rounded to one in n"
    )
    held_out_block_s: float = Field(
        default=2.0, gt=0, description="kept back in blocks this long, neighbours being alike [s]"
    )
    held_out_frames: int = Field(
        default=128, ge=8, description="newest held-out frames that judge; older ones are trained on"
    )
    margin: float = Field(default=0.05, ge=0, description="how much worse, relatively, still counts as not worse")
    trust_after_s: float = Field(default=60.0, ge=0, description="the gate stays open this long from the start [s]")
    keep: int = Field(default=8, ge=1, description="versions kept for roll-back")
