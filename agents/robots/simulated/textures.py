"""Procedural pictures of floors, walls and objects: seeded, tileable, from nothing but numpy, OpenCV and SciPy.

A pattern turns a random generator and a surface's colours into `SIZE` x `SIZE` RGB. Left and right edges meet, and so
do top and bottom, because every noise here wraps around.
"""

import zlib
from collections.abc import Callable
from functools import lru_cache
from itertools import product
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from agents.robots.simulated.scenario import Pattern, Surface

Image = NDArray[np.float32]
SIZE = 512  # a power of two, for mip-mapping; at one metre a repeat, one texel is finer than a pixel's foot


def texture(surface: Surface) -> NDArray[np.uint8]:
    """(SIZE, SIZE, 3) uint8 RGB, read-only; the same surface gives the same bytes in every layout and run.

    >>> texture(Surface(name="grey", pattern="plain", colours=["#808080", "#828282"], period_m=1.0)).shape
    (512, 512, 3)
    """
    return _draw(surface.pattern, surface.colours, seed=zlib.crc32(surface.model_dump_json().encode()))


@lru_cache(maxsize=64)
def _draw(pattern: Pattern, colours: tuple[str, ...], seed: int) -> NDArray[np.uint8]:
    rgb = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours], np.float32)
    image = np.clip(PATTERNS[pattern](np.random.default_rng(seed), rgb), 0, 255).astype(np.uint8)
    image.flags.writeable = False
    return image


def noise(rng: np.random.Generator, cells: tuple[int, int], octaves: int, gain: float = 0.5) -> Image:
    """Smooth noise in [0, 1], (SIZE, SIZE), wrapping around; `cells` of its coarsest octave down and across."""
    total = np.zeros((SIZE, SIZE), np.float32)
    for octave in range(octaves):
        rows, columns = (min(SIZE, cell << octave) for cell in cells)
        lattice = np.pad(rng.random((rows, columns), np.float32), 2, mode="wrap")
        # Two lattice cells of border on each side give the cubic its neighbours; what is kept starts right after them.
        height, width = SIZE // rows, SIZE // columns
        smooth = cv2.resize(lattice, ((columns + 4) * width, (rows + 4) * height), interpolation=cv2.INTER_CUBIC)
        total += gain**octave * smooth[2 * height : 2 * height + SIZE, 2 * width : 2 * width + SIZE]
    total -= total.min()
    return (total / total.max()).astype(np.float32)


def _ramp(position: NDArray[np.floating], colours: Image) -> Image:
    """Colours along a gradient, `position` running from 0 to 1."""
    stops = np.linspace(0, 1, len(colours))
    return np.stack([np.interp(position, stops, channel) for channel in colours.T], -1).astype(np.float32)


def _shade(image: Image, rng: np.random.Generator, amount: float, cells: int = 4) -> Image:
    """The same, lighter here and darker there by up to `amount`."""
    light = 1 - amount + 2 * amount * noise(rng, (cells, cells), 6, 0.6)
    return image * light[..., None].astype(np.float32)


def _plain(rng: np.random.Generator, colours: Image) -> Image:
    return _ramp(noise(rng, (4, 4), 6), colours)


def _grid(rng: np.random.Generator, rows: int, columns: int, shift: bool = False) -> tuple[Image, Image]:
    """A wall of rectangles: (SIZE, SIZE) random shade of each in [0, 1], and distance to its nearest edge in texels."""
    v, u = np.mgrid[:SIZE, :SIZE].astype(np.float32)
    row = (v * rows // SIZE).astype(np.int64)
    u = (u + (row % 2) * (SIZE / columns / 2 if shift else 0)) % SIZE
    column = (u * columns // SIZE).astype(np.int64)
    inside_v, inside_u = v - row * SIZE / rows, u - column * SIZE / columns
    edge = np.minimum(
        np.minimum(inside_v, SIZE / rows - 1 - inside_v), np.minimum(inside_u, SIZE / columns - 1 - inside_u)
    )
    return rng.random((rows, columns), np.float32)[row, column], edge


def _tiles(rng: np.random.Generator, colours: Image) -> Image:
    """Joint colour first, then the tiles'."""
    shade, edge = _grid(rng, 4, 4)
    tiles = _shade(_ramp(shade, colours[1:]), rng, 0.1, 8)
    return np.where((edge < 3)[..., None], colours[0], tiles).astype(np.float32)


def _checker(rng: np.random.Generator, colours: Image) -> Image:
    v, u = np.mgrid[:4, :4].repeat(SIZE // 4, 1).repeat(SIZE // 4, 2)
    return _shade(colours[(v + u) % 2], rng, 0.12, 8)


def _bricks(rng: np.random.Generator, colours: Image) -> Image:
    """Mortar colour first, then the bricks'."""
    shade, edge = _grid(rng, 8, 4, shift=True)
    bricks = _shade(_ramp(shade, colours[1:]), rng, 0.2, 16)
    return np.where((edge < 4)[..., None], colours[0], bricks).astype(np.float32)


def _planks(rng: np.random.Generator, colours: Image) -> Image:
    """Boards along one direction, each with its own grain and brightness."""
    boards = 8
    board = np.arange(SIZE) * boards // SIZE
    grain = noise(rng, (2, 32), 4, 0.7)
    rings = 0.5 + 0.5 * np.sin(12 * np.pi * noise(rng, (2, 16), 3))
    image = _ramp(0.65 * grain + 0.35 * rings, colours)
    for index, turn in enumerate(rng.integers(SIZE, size=boards)):
        image[:, board == index] = np.roll(image[:, board == index], turn, 0) * rng.uniform(0.85, 1.12)
    image[:, np.arange(SIZE) % (SIZE // boards) < 2] *= 0.55
    return image


def _cardboard(rng: np.random.Generator, colours: Image) -> Image:
    """Flutes that show through, and stains."""
    flutes = 0.5 + 0.5 * np.sin(2 * np.pi * 64 * np.arange(SIZE, dtype=np.float32) / SIZE)[:, None]
    return _ramp(0.12 * flutes + 0.18 * noise(rng, (64, 4), 3) + 0.7 * noise(rng, (4, 4), 5), colours)


def _linoleum(rng: np.random.Generator, colours: Image) -> Image:
    """Marbled: noise, folded."""
    folds = 0.5 + 0.5 * np.sin(14 * noise(rng, (4, 4), 5, 0.6))
    return _ramp(0.5 * folds + 0.5 * noise(rng, (16, 16), 5, 0.8), colours)


def _flagstones(rng: np.random.Generator, colours: Image) -> Image:
    """Joint colour first. Stones are the Voronoi cells of random points on a torus."""
    from scipy.spatial import KDTree  # takes longer to import than most arenas take to draw

    points = rng.random((40, 2)) * SIZE
    v, u = np.mgrid[:SIZE, :SIZE]
    nearest: Any = KDTree(points, boxsize=SIZE).query(np.stack([v, u], -1).reshape(-1, 2), k=2)
    distance, index = nearest
    shade = rng.random(len(points), np.float32)[index[:, 0]].reshape(SIZE, SIZE)
    joint = (distance[:, 1] - distance[:, 0] < 4).reshape(SIZE, SIZE, 1)
    return np.where(joint, colours[0], _shade(_ramp(shade, colours[1:]), rng, 0.25, 8)).astype(np.float32)


def _carpet(rng: np.random.Generator, colours: Image) -> Image:
    """Short fibres, and where feet have pressed them."""
    fibres = noise(rng, (128, 128), 2)
    return _ramp(0.6 * fibres + 0.4 * noise(rng, (4, 4), 4), colours)


def _grass(rng: np.random.Generator, colours: Image) -> Image:
    """Blades longer than wide, in tufts."""
    return _ramp(0.55 * noise(rng, (16, 64), 3, 0.8) + 0.45 * noise(rng, (8, 8), 4, 0.7), colours)


def _concrete(rng: np.random.Generator, colours: Image) -> Image:
    return _ramp(noise(rng, (4, 4), 8, 0.65), colours) + 5 * rng.standard_normal((SIZE, SIZE, 1), np.float32)


def _terrazzo(rng: np.random.Generator, colours: Image) -> Image:
    """Base colour first, then the chips'."""
    image = _shade(np.broadcast_to(colours[0], (SIZE, SIZE, 3)), rng, 0.06)
    return _scatter(image, rng, colours[1:], count=700, radius=(3, 10))


def _speckle(rng: np.random.Generator, colours: Image) -> Image:
    """Base colour first, then the specks'."""
    image = _shade(np.broadcast_to(colours[0], (SIZE, SIZE, 3)), rng, 0.2)
    return _scatter(image, rng, colours[1:], count=250, radius=(2, 16))


def _scatter(image: Image, rng: np.random.Generator, colours: Image, count: int, radius: tuple[float, float]) -> Image:
    """Draw random polygons, and what crosses an edge once more on the other side."""
    image = np.ascontiguousarray(image, np.float32)
    for _ in range(count):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 6))
        reach = rng.uniform(*radius) * rng.uniform(0.6, 1.4, 6)
        corners = rng.uniform(0, SIZE, 2) + np.stack([np.cos(angle), np.sin(angle)], -1) * reach[:, None]
        colour = colours[rng.integers(len(colours))] * rng.uniform(0.85, 1.15)
        for shift in product((-SIZE, 0, SIZE), repeat=2):
            cv2.fillPoly(image, [(corners + shift).round().astype(np.int32)], colour.astype(float).tolist())
    return image


def _stripes(rng: np.random.Generator, colours: Image) -> Image:
    return _shade(colours[np.arange(SIZE) * 16 // SIZE % len(colours)][None].repeat(SIZE, 0), rng, 0.12)


PATTERNS: dict[Pattern, Callable[[np.random.Generator, Image], Image]] = {
    "plain": _plain,
    "tiles": _tiles,
    "checker": _checker,
    "planks": _planks,
    "cardboard": _cardboard,
    "linoleum": _linoleum,
    "flagstones": _flagstones,
    "carpet": _carpet,
    "grass": _grass,
    "concrete": _concrete,
    "terrazzo": _terrazzo,
    "bricks": _bricks,
    "stripes": _stripes,
    "speckle": _speckle,
}
