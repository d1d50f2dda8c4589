"""Drives one manoeuvre in ROS 2, and stops the robot at its end and when it is interrupted.

KIND "cmd_vel": geometry_msgs/Twist on /cmd_vel (TwistStamped with `--ros-args -p stamped:=true`), forward speed in m/s
and yaw rate in rad/s. KIND "voltage": std_msgs/Float64MultiArray on /wheel_voltages, left and right in V, for a driver
of your own. Remap a topic by `--ros-args -r cmd_vel:=/robot/cmd_vel`. Record meanwhile: ros2 bag record -a.
"""

import itertools
import sys

KIND = "cmd_vel"
RATE_HZ = 50.0
COUNTDOWN_S = 3.0
# Time in s and both values, straight in between.
KNOTS: list = []


def command_at(t):
    """Both values at a time; nothing before the first knot and after the last."""
    if not KNOTS or t < KNOTS[0][0] or t >= KNOTS[-1][0]:
        return 0.0, 0.0
    for before, after in itertools.pairwise(KNOTS):
        if t < after[0]:
            share = (t - before[0]) / (after[0] - before[0])
            return tuple(before[k] + share * (after[k] - before[k]) for k in (1, 2))
    return 0.0, 0.0


def main():
    """Wait, drive, stop."""
    import rclpy
    from geometry_msgs.msg import Twist, TwistStamped
    from rclpy.node import Node
    from std_msgs.msg import Float64MultiArray

    rclpy.init(args=sys.argv)
    node = Node("rtds_plan")
    stamped = KIND == "cmd_vel" and node.declare_parameter("stamped", False).value
    if KIND == "voltage":
        publisher = node.create_publisher(Float64MultiArray, "wheel_voltages", 10)
    else:
        publisher = node.create_publisher(TwistStamped if stamped else Twist, "cmd_vel", 10)
    started = node.get_clock().now()

    def send(first, second):
        if KIND == "voltage":
            publisher.publish(Float64MultiArray(data=[first, second]))
            return
        message = TwistStamped() if stamped else Twist()
        twist = message.twist if stamped else message
        twist.linear.x, twist.angular.z = first, second
        if stamped:
            message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    def tick():
        t = (node.get_clock().now() - started).nanoseconds * 1e-9 - COUNTDOWN_S
        send(*command_at(t))
        if t >= KNOTS[-1][0]:
            raise SystemExit

    node.create_timer(1.0 / RATE_HZ, tick)
    node.get_logger().info(f"starting in {COUNTDOWN_S:g} s, {KNOTS[-1][0]:.1f} s long")
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, SystemExit):
        pass
    finally:
        if rclpy.ok():
            send(0.0, 0.0)
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
