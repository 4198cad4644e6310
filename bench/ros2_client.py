"""The far end of bench/test_ros2.py, run by the Python that has rclpy: sends pictures both ways, times predictions.

python bench/ros2_client.py ENDPOINT COUNT

Each picture goes out twice, through rclpy and straight to Zenoh, in turn; its stamp is the machine's clock. Predictions
are taken from ROS 2 and straight from Zenoh; their ages are printed as JSON.
"""

import json
import sys
import threading
import time

import numpy as np

from agents import messages
from agents.transport import Frames, Received, open_session, subscribe_latest

PICTURE, EVERY_S = "sensor_msgs/msg/CompressedImage", 0.025


def age_ms(data: bytes) -> float:
    """Since its stamp."""
    return (time.monotonic_ns() - (messages.stamp_ns("sensor_msgs/msg/PointCloud2", data) or 0)) / 1e6


def main() -> None:
    """Until all pictures are sent."""
    # Here, for whoever looks through all modules with another Python.
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import CompressedImage, PointCloud2

    endpoint, count = sys.argv[1], int(sys.argv[2])
    pixels = np.random.default_rng(0).integers(0, 255, (64, 80, 3), np.uint8)
    ages: dict[str, list[float]] = {"ros": [], "zenoh": []}
    rclpy.init()
    node = rclpy.create_node("bench")
    publisher = node.create_publisher(CompressedImage, "/camera/image/compressed", 10)
    node.create_subscription(PointCloud2, "/prediction", lambda data: ages["ros"].append(age_ms(data)), 10, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()

    def hear(message: Received) -> None:
        ages["zenoh"].append(age_ms(message.data))

    with open_session(endpoint, hub=False, name="bench_client") as session:
        subscribe_latest(session, "thymio/prediction", hear)
        straight = Frames(session, "thymio/straight", PICTURE)
        while not publisher.get_subscription_count():
            time.sleep(0.05)
        time.sleep(0.5)
        for number in range(2 * count):
            data = messages.encode(messages.compressed_image(time.monotonic_ns(), pixels))
            publisher.publish(data) if number % 2 else straight.put(data)
            time.sleep(EVERY_S)
        time.sleep(0.5)
    print(json.dumps(ages))
    executor.shutdown()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
