"""Pictures: RGB arrays in CompressedImage (JPEG, PNG) and in raw Image messages. RGB is our one colour order."""

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__CompressedImage as CompressedImage
from rosbags.typesys.stores.ros2_jazzy import sensor_msgs__msg__Image as Image

from agents.messages.codec import MessageError, header
from agents.messages.shortcut import flat_picture

Pixels = NDArray[np.uint8]

# Encoding of a raw Image -> its bytes a pixel, and what makes RGB of it.
_TO_RGB: dict[str, tuple[int, int | None]] = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
}
_JPEG_BEGIN, _JPEG_END = b"\xff\xd8", b"\xff\xd9"


def compressed_image(
    t_ns: int, pixels: Pixels, codec: Literal["jpeg", "png"] = "jpeg", quality: int = 90, frame: str = "camera"
) -> CompressedImage:
    """`pixels` (H, W, 3) uint8 RGB as a sensor_msgs/CompressedImage; `quality` is JPEG's, 1 to 100."""
    _check(pixels)
    return CompressedImage(header(t_ns, frame), codec, _encoded(pixels, codec, quality))


def jpeg(pixels: Pixels, quality: int) -> bytes:
    """`pixels` (H, W, 3) uint8 RGB as a file; `quality` 1 to 100."""
    return _encoded(pixels, "jpeg", quality).tobytes()


def _encoded(pixels: Pixels, codec: str, quality: int) -> Pixels:
    options = [cv2.IMWRITE_JPEG_QUALITY, quality] if codec == "jpeg" else []
    _, data = cv2.imencode(f".{codec}", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), options)
    return np.asarray(data, np.uint8).ravel()


def image(t_ns: int, pixels: Pixels, frame: str = "camera") -> Image:
    """`pixels` (H, W, 3) uint8 RGB as a raw sensor_msgs/Image, encoding rgb8."""
    _check(pixels)
    height, width, _ = pixels.shape
    return Image(header(t_ns, frame), height, width, "rgb8", 0, 3 * width, np.ascontiguousarray(pixels).ravel())


def picture(message: object) -> Pixels:
    """The picture in a CompressedImage or Image, (H, W, 3) uint8 RGB at its own size, grey ones made RGB.

    MessageError where there is no whole picture in it.

    >>> red = np.full((2, 4, 3), [255, 0, 0], np.uint8)
    >>> picture(compressed_image(0, red, "png"))[0, 0].tolist()
    [255, 0, 0]
    """
    if isinstance(message, CompressedImage):
        return _decompress(message.data.tobytes(), message.format)
    if isinstance(message, Image):
        return _raw(message)
    got = getattr(message, "__msgtype__", type(message).__name__)
    raise MessageError(f"expected sensor_msgs/msg/CompressedImage or sensor_msgs/msg/Image, got {got}")


def quick_picture(data: bytes) -> tuple[int, Pixels] | None:
    """Time [ns] and `picture` of the CompressedImage in these bytes, sooner; None where they must be decoded."""
    flat = flat_picture(data)
    return None if flat is None else (flat.t_ns, _decompress(flat.data, flat.codec))


def _decompress(data: bytes, codec: str) -> Pixels:
    # The decoder fills what is missing of a cut JPEG with grey and says nothing. Looked for from the end, where it is.
    if data.startswith(_JPEG_BEGIN) and data.rfind(_JPEG_END) < 0:
        raise MessageError("not a decodable picture: a JPEG that is cut short")
    try:
        found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB) if data else None
    except cv2.error as error:
        raise MessageError(f"not a decodable picture: {error.err}") from error
    if found is None:
        raise MessageError(f"not a decodable picture: {len(data)} bytes called {codec!r}; expected JPEG or PNG")
    return np.asarray(found, np.uint8)


def _raw(message: Image) -> Pixels:
    if message.encoding not in _TO_RGB:
        raise MessageError(
            f"not a decodable picture: encoding {message.encoding!r}; expected one of {', '.join(_TO_RGB)}"
        )
    channels, conversion = _TO_RGB[message.encoding]
    height, width, step = message.height, message.width, message.step
    if not height or not width or step < width * channels or len(message.data) < step * height:
        raise MessageError(
            f"not a decodable picture: {width}x{height} {message.encoding} with step {step} needs "
            f"{max(step, width * channels) * height} bytes and at least one pixel, got {len(message.data)}"
        )
    rows = message.data[: step * height].reshape(height, step)[:, : width * channels]
    pixels = rows.reshape(height, width, channels)
    if conversion is None:
        return np.array(pixels, np.uint8)
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), conversion), np.uint8)


def _check(pixels: Pixels) -> None:
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8 or not pixels.size:
        raise MessageError(f"picture: expected (H, W, 3) uint8, got {pixels.shape} {pixels.dtype}")
