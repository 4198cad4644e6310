"""Films for a camera that is a file."""

from pathlib import Path

import cv2
import numpy as np

RED, WIDTH, HEIGHT = (250, 20, 10), 64, 48


def film(path: Path, pictures: int, *, still: bool = False) -> str:
    """A file of pictures, red with a bar that moves; OpenCV's order is blue first."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, (WIDTH, HEIGHT))
    for index in range(pictures):
        picture = np.full((HEIGHT, WIDTH, 3), RED[::-1], np.uint8)
        picture[:, 10 if still else 2 * index % WIDTH] = 255
        writer.write(picture)
    writer.release()
    return str(path)
