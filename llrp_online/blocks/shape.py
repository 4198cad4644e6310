"""How large a block is, and how its pictures lie in memory: all that its kernels are made for.

A picture lies channels last, in a frame of zeros as wide as the convolution reaches: what a filter covers is then
`kernel` runs of `kernel * channels` numbers each, whatever the stride. Behind each picture is room for what the last
vectors reach over its end.
"""

from typing import NamedTuple

#: Cycles, at two sums a cycle, until a sum can take its next number: so many sums keep a processor busy.
LATENCY = 8


class Shape(NamedTuple):
    """All that a block's kernels are made for: integers, which numba takes as constants.

    Attributes:
        height: rows of the input, without its frame.
        width: its columns.
        channels: its channels.
        outputs: channels of the output.
        kernel: rows and columns of a filter; odd.
        stride: of the convolution.
        frame_after: rows and columns of zeros around the output, on each side.
        lanes: numbers in a vector.
        registers: vectors that sums may stand in.
        written_by: a digest of what writes the kernels, since numba's cache knows them by their constants.
    """

    height: int
    width: int
    channels: int
    outputs: int
    kernel: int
    stride: int
    frame_after: int
    lanes: int
    registers: int
    written_by: int

    @property
    def rows(self) -> int:
        """Of the map that is pooled."""
        return -(-self.height // self.stride)

    @property
    def columns(self) -> int:
        """Of the map that is pooled."""
        return -(-self.width // self.stride)

    @property
    def pooled_rows(self) -> int:
        """Of the output."""
        return -(-self.rows // 2)

    @property
    def pooled_columns(self) -> int:
        """Of the output."""
        return -(-self.columns // 2)

    @property
    def frame(self) -> int:
        """Zeros around the input, on each side."""
        return self.kernel // 2

    @property
    def row(self) -> int:
        """Numbers in a row of the framed input."""
        return (self.width + 2 * self.frame) * self.channels

    @property
    def row_after(self) -> int:
        """Numbers in a row of the framed output."""
        return (self.pooled_columns + 2 * self.frame_after) * self.outputs

    @property
    def first_after(self) -> int:
        """Where the output begins, within its frame."""
        return self.frame_after * (self.row_after + self.outputs)

    @property
    def size(self) -> int:
        """Numbers in a framed input, and behind it what the last vectors reach over its end."""
        rows = self.height + 2 * self.frame + self.stride
        return rows * self.row + self.stride * self.channels + self.lanes

    @property
    def size_after(self) -> int:
        """Numbers in a framed output, likewise; where another block follows, its `size` counts."""
        return (self.pooled_rows + 2 * self.frame_after) * self.row_after + self.lanes

    @property
    def output_lanes(self) -> int:
        """Numbers in a vector of output channels: fewer where there are few."""
        return min(self.lanes, 1 << (self.outputs - 1).bit_length())

    @property
    def output_vectors(self) -> int:
        """Vectors that hold the output channels."""
        return -(-self.outputs // self.output_lanes)

    @property
    def output_run(self) -> int:
        """Output channels, rounded up to whole vectors."""
        return self.output_vectors * self.output_lanes

    @property
    def run(self) -> int:
        """A run under a filter, rounded up to whole vectors."""
        return -(-self.kernel * self.channels // self.lanes) * self.lanes

    @property
    def seen_run(self) -> int:
        """A row of what a window sees, rounded up to whole vectors."""
        return -(-(self.kernel + self.stride) * self.channels // self.lanes) * self.lanes

    @property
    def listed(self) -> int:
        """Entries that the longest list of live places may need."""
        return max(self.pooled_rows * self.pooled_columns + LATENCY, 2 * self.outputs + 1)
