"""Takes the figures of a run's report into docs/pictures, small enough to commit.

llrp demo --minutes 2 --output runs/pictures
python docs/pictures.py runs/pictures
"""

import argparse
import base64
import io
import re
from pathlib import Path

from PIL import Image

FOLDER = Path(__file__).parent / "pictures"
#: What a figure's description begins with -> the file it becomes.
FIGURES = {"Camera pictures": "examples.png", "AUC by distance": "auc.png", "Path of the robot": "path.png"}
_WIDTH_PX = 1240
_MOST_BYTES = 300_000


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder with report.html")
    page = (parser.parse_args().run / "report.html").read_text(encoding="utf-8")
    FOLDER.mkdir(exist_ok=True)
    for data, alt in re.findall(r'base64,([A-Za-z0-9+/=]+)" alt="([^"]*)"', page):
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
