"""What missing channels cost."""

from __future__ import annotations

from rtds_host.contract import Case


def undetermined(case: Case) -> tuple[str, ...]:
    """What the channels that are missing keep from being distinguished, in words."""
    robot = case.robot

    def there(*names: str) -> bool:
        return any(all(log.has(n) and robot.noise(n) is not None for n in names) for log in case.runs)

    result = []
    sides = robot.sides
    if robot.driver.mode != "torque" and not all(there(f"i_{s}") for s in sides):
        result.append("without current, driver and winding cannot be distinguished from the drivetrain")
    if robot.driver.bus == "nominal" and robot.driver.mode == "voltage" and not there("v_bus"):
        result.append("without v_bus, the supply cannot be distinguished from driver and winding")
    if any(not there(f"w_{s}", f"th_{s}") for s in sides):
        result.append("with only one of speed and angle, errors of the speed sensor show in no comparison of the two")
    if robot.chassis is not None:
        if not there("gyro_z") and not there("yaw"):
            result.append("without gyro and yaw, nothing between the wheels and the body's motion can be seen")
        elif not (there("gyro_z") and there("yaw")):
            result.append("with only one of gyro and yaw, the gyro cannot be distinguished from the ground contact")
        if not there("x", "y"):
            result.append("without x and y, wheel radius and track width are indistinguishable")
    return tuple(result)
