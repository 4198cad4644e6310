"""A real Thymio: five proximity sensors, odometry from its wheels, its motors, and a camera beside it.

`link` is the line, `firmware` what runs on the robot and is said over the line, `wheels` and `proximity` turn its
numbers into metres, `clock` its beats into time; `camera` is the camera, `live` puts all of it on the bus. Needs the
extra `thymio`.
"""
