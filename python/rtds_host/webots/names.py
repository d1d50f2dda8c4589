"""What a world's file and the controller have to agree on: names of nodes, devices and files."""

WHEEL_MOTORS = ("left wheel motor", "right wheel motor")
WHEEL_SENSORS = ("left wheel sensor", "right wheel sensor")
GPS = "gps"
GYRO = "gyro"
CONTROLLER = "rtds_motors"
SETTINGS = "webots.json"
