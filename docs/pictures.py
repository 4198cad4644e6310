"""Takes the figures of pages that were written by runs into docs/pictures, small enough to commit.

llrp demo --minutes 2 --drive-minutes 0.5 --held-out-minutes 2 --output runs/pictures
llrp record --simulate --behaviour walk --minutes 10 --output walk.mcap
llrp window walk.mcap --config configs/thymio.toml --output runs/window.html
python docs/pictures.py runs/pictures/report.html runs/window.html
"""

import argparse
import base64
import io
import re
from pathlib import Path

from PIL import Image

FOLDER = Path(__file__).parent / "pictures"
#: What a figure's description begins with -> the file it becomes.
FIGURES = {
    "Camera pictures": "examples.png",
    "AUC by distance": "auc.png",
    "Path of the robot": "path.png",
    "Known labels by distance": "known.png",
    "Known labels a frame": "window.png",
}
_WIDTH_PX = 1240
_MOST_BYTES = 300_000


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", type=Path, nargs="+", help="such as report.html of a demo")
    FOLDER.mkdir(exist_ok=True)
    for page in parser.parse_args().pages:
        for data, alt in re.findall(r'base64,([A-Za-z0-9+/=]+)" alt="([^"]*)"', page.read_text(encoding="utf-8")):
            name = next((file for begin, file in FIGURES.items() if alt.startswith(begin)), None)
            if name is not None:
                size = save(base64.b64decode(data), FOLDER / name)
                print(f"{FOLDER / name}: {size / 1e3:.0f} kB")


def save(data: bytes, file: Path) -> int:
    """A PNG, scaled down to a page's width and to 256 colours; its bytes."""
    picture = Image.open(io.BytesIO(data)).convert("RGB")
    if picture.width > _WIDTH_PX:
        height = round(picture.height * _WIDTH_PX / picture.width)
        picture = picture.resize((_WIDTH_PX, height), Image.Resampling.LANCZOS)
    picture.quantize(256, dither=Image.Dither.NONE).save(file, optimize=True)
    size = file.stat().st_size
    if size > _MOST_BYTES:
        raise ValueError(f"{file}: {size} bytes, expected at most {_MOST_BYTES}")
    return size


if __name__ == "__main__":
    main()
