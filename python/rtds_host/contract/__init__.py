"""The contract: formats of robots, runs and cases that others' logs and scripts depend on."""

from rtds_host.contract.output import check_writable, check_writable_file, refuse_inputs, staged_folder, write_atomic
from rtds_host.contract.robot import (
                                      GRAVITY_M_S2,
                                      Axis,
                                      Chassis,
                                      Driver,
                                      Motor,
                                      Robot,
                                      Servo,
                                      builtin_robot,
                                      builtin_robot_path,
                                      builtin_robots,
                                      load_robot,
)
from rtds_host.contract.runlog import (
                                      Case,
                                      RunLog,
                                      RunMeta,
                                      places_of_case,
                                      places_of_run,
                                      read_case,
                                      read_meta,
                                      read_run,
                                      read_writable_case,
                                      write_csv,
                                      write_run,
)

__all__ = ["GRAVITY_M_S2", "Axis", "Case", "Chassis", "Driver", "Motor", "Robot", "RunLog", "RunMeta", "Servo",
           "builtin_robot", "builtin_robot_path", "builtin_robots", "check_writable", "check_writable_file", "load_robot", "places_of_case",
           "places_of_run", "read_case", "read_meta", "read_run", "read_writable_case", "refuse_inputs", "staged_folder", "write_atomic", "write_csv", "write_run"]
